//! What a distance after the alignment says: the same fruit, or a stranger that hangs there by chance.

use crate::neighbours::index::Index;
use nalgebra::Point3;
use std::f64::consts::PI;

/// Neighbours whose sphere measures the density about a fruit: enough to even out clusters, few enough to stay local.
const NEIGHBOURS: usize = 10;
/// Least noise per axis, metres; clean copies would else divide by zero.
const MIN_NOISE_M: f64 = 1e-6;
/// Median of the length of a vector of three standard normal numbers.
const MEDIAN_OF_CHI_3: f64 = 1.538_172_254_5;

/// The map's local density.
#[derive(Debug)]
pub(crate) struct PairOdds {
    fruits: Index<3>,
}

impl PairOdds {
    pub(crate) fn new(fruits: Index<3>) -> Self {
        Self { fruits }
    }

    /// Odds that a pair at `distance_m` is one fruit: the Gaussian density of its residual over the density of map
    /// fruits about it.
    pub(crate) fn odds(&self, in_map: &Point3<f64>, distance_m: f64, noise_m: f64) -> f64 {
        let noise_m = noise_m.max(MIN_NOISE_M);
        let found = self.fruits.nearest_few(&[in_map.x, in_map.y, in_map.z], NEIGHBOURS + 1);
        let radius = found.last().map_or(0.0, |n| n.distance).max(noise_m);
        let strangers = found.len() as f64 / (4.0 / 3.0 * PI * radius.powi(3));
        let same = (-0.5 * (distance_m / noise_m).powi(2)).exp() / (2.0 * PI * noise_m * noise_m).powf(1.5);
        same / strangers
    }

    /// Noise per axis from distances of true pairs, by their median; NaN where there are none.
    pub(crate) fn noise_per_axis(distances: &[f64]) -> f64 {
        let mut sorted = distances.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).map_or(f64::NAN, |median| median / MEDIAN_OF_CHI_3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_the_same_and_far_a_stranger() {
        let lattice = (0..1000).map(|i| [i % 10, i / 10 % 10, i / 100].map(|x| 0.2 * f64::from(x))).collect();
        let evidence = PairOdds::new(Index::new(lattice));
        let middle = Point3::new(1.0, 1.0, 1.0);
        assert!(evidence.odds(&middle, 0.02, 0.02) > 10.0);
        assert!(evidence.odds(&middle, 0.12, 0.02) < 0.1);
        // The density of the lattice is 125 fruits per cubic metre.
        let at_zero = 1.0 / (2.0 * PI * 0.02f64.powi(2)).powf(1.5);
        let density = at_zero / evidence.odds(&middle, 0.0, 0.02);
        assert!((60.0..250.0).contains(&density), "{density}");
    }

    #[test]
    fn noise_is_read_from_the_median() {
        let distances: Vec<_> = [0.02, 0.03, 0.04].map(|d| d * MEDIAN_OF_CHI_3).to_vec();
        assert!((PairOdds::noise_per_axis(&distances) - 0.03).abs() < 1e-12);
        assert!(PairOdds::noise_per_axis(&[]).is_nan());
    }
}
