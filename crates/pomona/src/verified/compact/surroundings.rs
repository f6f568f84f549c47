//! What hangs next to a fruit, in one line of memory.
//!
//! Most candidates are wrong, and three or four fruits next to them show it. Where those are is asked a million times, and each
//! time memory that nobody has read before has to be waited for. So the places of a fruit's neighbours are written down once
//! more, relative to it, a byte for each coordinate.

use nalgebra::Vector3;

/// Neighbours that are written down, nearest first.
pub(super) const NEAR: usize = 20;

/// Their places along x, y and z, in steps, then the density at the fruit in single precision.
pub(super) type Surroundings = [u8; 3 * NEAR + 4];

/// Steps of a spacing: 17 mm in an orchard, which adds a sixteenth to the variance of the noise; a byte reaches 2 m.
const STEPS: f64 = 16.0;

/// Metres of a step in a map of this spacing.
pub(super) fn step_of(spacing: f64) -> f64 {
    spacing / STEPS
}

/// Steps that a byte holds.
const FARTHEST: f64 = 127.0;

/// Of a neighbour that is not there, or too far away to be written down.
const ABSENT: u8 = i8::MIN.cast_unsigned();

/// What hangs next to a fruit: offsets of its neighbours, nearest first, metres.
pub(super) fn packed(offsets: impl Iterator<Item = Vector3<f64>>, density: f64, step: f64) -> Surroundings {
    let mut bytes = [ABSENT; 3 * NEAR + 4];
    for (at, offset) in offsets.take(NEAR).enumerate().filter(|(_, offset)| offset.norm() <= FARTHEST * step) {
        for axis in 0..3 {
            bytes[axis * NEAR + at] = ((offset[axis] / step).round() as i8).cast_unsigned();
        }
    }
    bytes[3 * NEAR..].copy_from_slice(&(density as f32).to_ne_bytes());
    bytes
}

/// Fruits per cubic metre that chance puts at the fruit.
#[inline]
pub(super) fn density_of(surroundings: &Surroundings) -> f64 {
    let bytes = std::array::from_fn(|byte| surroundings[3 * NEAR + byte]);
    f64::from(f32::from_ne_bytes(bytes))
}

/// The same as numbers.
pub(super) struct Neighbourhood {
    /// Along x, y and z, steps; those that are absent lie beyond `radius`.
    offsets: [[f32; NEAR]; 3],
    /// Metres within which no neighbour is missing.
    pub(super) radius: f64,
    pub(super) density: f64,
    step: f64,
}

impl Neighbourhood {
    #[inline]
    pub(super) fn new(bytes: &Surroundings, step: f64) -> Self {
        let axis = |axis: usize| std::array::from_fn(|at| f32::from(bytes[axis * NEAR + at].cast_signed()));
        let offsets: [[f32; NEAR]; 3] = [axis(0), axis(1), axis(2)];
        let [x, y, z] = offsets.map(|axis| f64::from(axis[NEAR - 1]));
        let radius = (x * x + y * y + z * z).sqrt().min(FARTHEST) * step;
        Self { offsets, radius, density: density_of(bytes), step }
    }

    /// A neighbour by its number from 1 on, 0 being the fruit itself, metres from there; `None` where it is absent.
    #[inline]
    pub(super) fn place(&self, number: usize) -> Option<Vector3<f64>> {
        let Some(at) = number.checked_sub(1) else { return Some(Vector3::zeros()) };
        let offset = self.offsets.map(|axis| f64::from(axis[at]));
        (offset[0] > -FARTHEST - 0.5).then(|| Vector3::from(offset) * self.step)
    }

    /// Squared distance from a place, metres from the fruit, to the nearest of all.
    #[inline]
    pub(super) fn nearest(&self, place: &Vector3<f64>) -> f64 {
        let [x, y, z] = [place.x, place.y, place.z].map(|value| (value / self.step) as f32);
        let [xs, ys, zs] = &self.offsets;
        let mut nearest = [x * x + y * y + z * z; LANES];
        for first in (0..NEAR).step_by(LANES) {
            for (lane, least) in nearest.iter_mut().enumerate() {
                let (dx, dy, dz) = (xs[first + lane] - x, ys[first + lane] - y, zs[first + lane] - z);
                *least = least.min(dx * dx + dy * dy + dz * dz);
            }
        }
        f64::from(nearest.into_iter().fold(f32::INFINITY, f32::min)) * self.step * self.step
    }
}

/// Neighbours that are measured at once.
const LANES: usize = 4;
const _: () = assert!(NEAR.is_multiple_of(LANES));

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_nearest_is_that_of_brute_force_within_a_step(
            mut offsets in prop::collection::vec(prop::array::uniform3(-1.5..1.5f64).prop_map(Vector3::from), 0..30),
            place in prop::array::uniform3(-0.6..0.6f64).prop_map(Vector3::from),
        ) {
            let step = 0.01;
            offsets.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
            let near = Neighbourhood::new(&packed(offsets.iter().copied(), 3.5, step), step);
            prop_assert!((near.density - 3.5).abs() < 1e-6);
            let brute = offsets.iter().map(|offset| (offset - place).norm()).fold(place.norm(), f64::min);
            let found = near.nearest(&place).sqrt();
            // What lies beyond the radius may be missing.
            if place.norm() + brute < near.radius {
                prop_assert!((found - brute).abs() < step, "{} {}", found, brute);
            }
            for (at, offset) in offsets.iter().take(NEAR).enumerate() {
                match near.place(at + 1) {
                    Some(place) => prop_assert!((place - offset).norm() < step),
                    None => prop_assert!(offset.norm() > FARTHEST * step),
                }
            }
        }
    }
}
