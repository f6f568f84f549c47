//! How much denser strangers are where a cloud lies on itself than the kernels say.
//!
//! A row is made of walls, wires, a cordon, a roof, shells of round crowns, and a wrong pose lays these on themselves, moved
//! along: then strangers meet within the thickness of what they hang on. The kernels of [`super::chance`] are as flat as the cloud
//! around, but the two legs of a V, or wires above each other, do not show from sixty neighbours how thin each is, and a shell
//! is curved where it is as wide as those. So the cloud is moved along itself and its fruits that then meet are weighed as those
//! of two visits would be: under the density that strangers have, the mean of the likelihood ratio is one.

use super::chance::Sheet;
use crate::neighbours::others::{Neighbours, each_row};
use crate::principal::Principal;
use nalgebra::Vector3;

/// Noise under which fruits meet, in spacings: 2 to 4 cm in an orchard.
const NOISE: f64 = 0.1;

/// A cluster is narrower than this, in spacings: a cloud that is moved so far along itself meets other fruits.
pub(super) const BEYOND_A_CLUSTER: f64 = 0.6;

/// How far the cloud is moved, in spacings: not beyond the neighbours that are listed.
const MOVED: [f64; 2] = [BEYOND_A_CLUSTER, 1.6];

/// Standard deviations of a count that are taken off: of three axes the one that shows most counts, and a dozen fruits show a layer
/// where there is none.
const UNSURE: f64 = 2.0;

/// How many times as dense as `density` says strangers are, less what few pairs may show by chance; 1 at the least.
///
/// Of the three axes of the cloud and the sheets it is made of, that counts along which most fruits meet.
pub(super) fn denser(
    points: &[Vector3<f64>],
    neighbours: &Neighbours,
    spacing: f64,
    sheets: &[Sheet],
    density: &[f64],
) -> f64 {
    let axes = Principal::of(points.iter()).map(|found| found.ways());
    let cloud = Moved { points, neighbours, spacing, density };
    let along = axes.into_iter().flatten().map(|axis| cloud.along(&axis));
    along.fold(cloud.within(sheets), f64::max).max(1.0)
}

/// A cloud that is moved along itself.
struct Moved<'a> {
    points: &'a [Vector3<f64>],
    neighbours: &'a Neighbours,
    spacing: f64,
    density: &'a [f64],
}

impl Moved<'_> {
    /// Mean likelihood ratio of a fruit on the cloud moved along `axis`, either way, less `UNSURE` standard deviations.
    fn along(&self, axis: &Vector3<f64>) -> f64 {
        let [from, to] = self.way();
        let met = self.meetings(2, |row, other| {
            let apart = self.points[other] - self.points[row];
            let ahead = apart.dot(axis);
            (ahead.abs(), apart.norm_squared() - ahead * ahead)
        });
        let places = self.points.iter().map(|p| p.dot(axis));
        let (first, last) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        // Beyond its ends there is none of the cloud to meet.
        let left = |x: f64| [last - x, x - first].map(|left| (left - from).clamp(0.0, to - from)).iter().sum::<f64>();
        met.ratio(self.points.iter().map(|p| left(p.dot(axis))).sum())
    }

    /// The same of the cloud moved any way along the sheets around its fruits, flat or curved.
    ///
    /// A chord of a sphere is perpendicular to the mean of the normals at its ends: what it has along that mean is how far one
    /// fruit lies off the sheet through the other.
    fn within(&self, sheets: &[Sheet]) -> f64 {
        let [from, to] = self.way();
        let met = self.meetings(1, |row, other| {
            let apart = self.points[other] - self.points[row];
            let [here, there] = [row, other].map(|at| sheets[at].normal);
            let off = apart.dot(&(here + there * here.dot(&there).signum()).normalize());
            ((apart.norm_squared() - off * off).max(0.0).sqrt(), off * off)
        });
        met.ratio(std::f64::consts::PI * (to * to - from * from) * self.points.len() as f64)
    }

    /// How far the cloud is moved.
    fn way(&self) -> [f64; 2] {
        MOVED.map(|share| share * self.spacing)
    }

    /// Fruits that meet where `apart` says how far one is ahead of another and how far across, squared, in `ways` dimensions.
    fn meetings(&self, ways: i32, apart: impl Fn(usize, usize) -> (f64, f64) + Sync + Send) -> Meetings {
        let [from, to] = self.way();
        let variance = (NOISE * self.spacing).powi(2);
        let of_each = each_row(self.points.len(), |row| {
            let met = |&other: &u32| {
                let (ahead, across) = apart(row, other as usize);
                let meets = (from..to).contains(&ahead);
                let weight = if meets { (-0.5 * across / variance).exp() } else { 0.0 };
                [weight, weight / self.density[other as usize]]
            };
            self.neighbours.of(row).iter().map(met).fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d])
        });
        let [pairs, sum] = of_each.iter().fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
        // Both of a pair count the other.
        let peak = (2.0 * std::f64::consts::PI * variance).powf(-0.5 * f64::from(ways));
        Meetings { pairs: 0.5 * pairs, sum: peak * sum }
    }
}

/// Fruits of a cloud that meet where it is moved along itself.
struct Meetings {
    /// How many, each by its likelihood over that of one without noise.
    pairs: f64,
    /// Their likelihoods over the density of strangers, added up.
    sum: f64,
}

impl Meetings {
    /// Mean likelihood ratio where all fruits together are moved over `way`, less `UNSURE` standard deviations.
    fn ratio(&self, way: f64) -> f64 {
        if self.pairs > 0.0 { self.sum / way * (1.0 - UNSURE / self.pairs.sqrt()) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::statistics::{gaussian, upper_median};
    use crate::verified::fixture::Dice;
    use crate::verified::landscape::Landscape;

    /// Median density of fruits over that of fruits spread evenly in a box of 6 by 1 by 2 m, each where `hung` puts it.
    fn density(hung: impl Fn(Vector3<f64>, f64) -> Vector3<f64>) -> f64 {
        let mut dice = Dice(7);
        let fruit = |_: usize| {
            let place = Vector3::new(6.0 * dice.uniform(), dice.uniform() - 0.5, 2.0 * dice.uniform());
            hung(place, 0.02 * dice.normal().x).into()
        };
        let fruits: Vec<_> = (0..400).map(fruit).collect();
        let mut density = Landscape::new(&FruitCloud::from_positions(fruits)).density;
        upper_median(&mut density) * 12.0 / 400.0
    }

    #[test]
    fn strangers_are_as_dense_as_the_layer_they_hang_on_is_thin() {
        // Two centimetres of noise and half as much again that the density assumes: (2 pi)^(1/2) 3 cm of depth for 1 m.
        let legs = density(|p, off| Vector3::new(p.x, p.y.signum() * (0.3 + 0.36 * p.z) + off, p.z));
        assert!((0.5 * 5.0..0.5 * 20.0).contains(&legs), "{legs}");
        let box_of_fruits = density(|p, _| p);
        assert!((0.7..1.2).contains(&box_of_fruits), "{box_of_fruits}");
    }

    /// Mean likelihood ratio of a fruit of a visit on another one without a common fruit.
    fn strangers(mut visit: impl FnMut() -> Vec<Vector3<f64>>) -> f64 {
        let (query, map) = (visit(), visit());
        let cloud = FruitCloud::from_positions(map.iter().map(|&p| p.into()).collect());
        let landscape = Landscape::new(&cloud);
        let variance = (NOISE * landscape.spacing).powi(2);
        let ratio = |p: &Vector3<f64>| {
            let of = |(at, q): (usize, &Vector3<f64>)| {
                gaussian((q + landscape.centre - p).norm_squared(), variance) / landscape.density[at]
            };
            landscape.points.iter().enumerate().map(of).sum::<f64>()
        };
        query.iter().map(ratio).sum::<f64>() / query.len() as f64
    }

    #[test]
    fn the_mean_likelihood_ratio_of_strangers_on_wires_is_near_one() {
        let mut dice = Dice(11);
        let mean = strangers(|| {
            let on_a_wire = |i: usize| Vector3::new(8.0 * dice.uniform(), 0.0, 0.4 * (i % 4) as f64);
            let wires: Vec<_> = (0..300).map(on_a_wire).collect();
            wires.into_iter().map(|p| p + 0.02 * dice.normal().component_mul(&Vector3::new(0.0, 1.0, 1.0))).collect()
        });
        assert!((0.7..1.6).contains(&mean), "{mean}");
    }

    #[test]
    fn the_mean_likelihood_ratio_of_strangers_on_shells_is_near_one() {
        // Round crowns of 2.8 m whose fruits hang in the outermost decimetre: under the kernels alone it is 3.3.
        let mut dice = Dice(13);
        let mean = strangers(|| {
            let on_a_shell = |i: usize| {
                let centre = Vector3::new(3.5 * (i % 4) as f64, 0.0, 0.0);
                centre + dice.normal().normalize() * 1.4 * (0.9 + 0.1 * dice.uniform())
            };
            (0..600).map(on_a_shell).collect()
        });
        assert!((0.7..1.3).contains(&mean), "{mean}");
    }
}
