//! Numbers that look random and depend on a place alone, so that every picture shows the same texture there.

use crate::Vec3;

/// Scrambles an integer place (the finaliser of `MurmurHash3` over a linear mix).
pub fn hash(x: i32, y: i32, z: i32, seed: u32) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x8DA6_B343)
        ^ (y as u32).wrapping_mul(0xD816_3841)
        ^ (z as u32).wrapping_mul(0xCB1A_B31F)
        ^ seed.wrapping_mul(0x9E37_79B9);
    h = (h ^ (h >> 16)).wrapping_mul(0x85EB_CA6B);
    h = (h ^ (h >> 13)).wrapping_mul(0xC2B2_AE35);
    h ^ (h >> 16)
}

/// A number from 0 to 1 out of a scrambled one.
pub fn unit(hashed: u32) -> f32 {
    (hashed >> 8) as f32 / (1 << 24) as f32
}

/// Smooth value noise, 0 to 1, with features of length 1.
pub fn noise(place: Vec3, seed: u32) -> f32 {
    let floor = place.map(f32::floor);
    let [x, y, z] = [floor.x as i32, floor.y as i32, floor.z as i32];
    let t = (place - floor).map(|t| t * t * (3.0 - 2.0 * t));
    let corner = |i: i32, j: i32, k: i32| unit(hash(x + i, y + j, z + k, seed));
    let along_x = |j, k| mix(corner(0, j, k), corner(1, j, k), t.x);
    let along_y = |k| mix(along_x(0, k), along_x(1, k), t.y);
    mix(along_y(0), along_y(1), t.z)
}

/// Noise of halving features, 0 to 1.
pub fn octaves(place: Vec3, count: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut place) = (0.0, 0.5, place);
    for octave in 0..count {
        sum += weight * noise(place, seed + octave);
        weight *= 0.5;
        place *= 2.03;
    }
    sum + weight
}

/// From `a` to `b`.
pub fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// From one colour to another.
pub fn blend(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a + (b - a) * t
}

/// 0 below `low`, 1 above `high`, smooth between; falling where `low` is above `high`.
pub fn step(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smooth_and_within_its_bounds() {
        let mut before = noise(Vec3::new(-3.0, 0.3, 7.1), 5);
        for number in 1..6000 {
            let now = noise(Vec3::new(-3.0 + number as f32 * 1e-3, 0.3, 7.1), 5);
            assert!((0.0..=1.0).contains(&now) && (now - before).abs() < 3e-3);
            before = now;
        }
    }
}
