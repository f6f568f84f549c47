//! How dense strangers are for a sighting that does not know well where it lies.
//!
//! The matcher has the strangers about each fruit of the map ([`crate::verified`]), on a wire those of the wire. A sighting whose depth is
//! known to half a metre meets a wire no more often than it meets what is as far behind and before it: of strangers too only their
//! density under the sighting's own covariance counts, or the more is seen of a row from afar, the less the true pose would be believed.
//! With the kernels K of the matcher's density and the covariance C of a sighting, strangers about the fruit m are
//! `sum over k of N(k - m; K + C) / sum over k of N(k - m; K)` times as dense, k all other fruits.

use crate::neighbours::tree::{Tree, single};
use crate::verified::{SEEN, kernels_among};
use nalgebra::{Matrix3, Vector3};
use std::sync::OnceLock;

/// Standard deviations beyond which a kernel has nothing.
const RIM: f64 = 3.0;

/// Fruits farther away than this say nothing of a place, metres: half of the way to the next row.
pub(super) const WIDEST_M: f64 = 1.5;

/// The fruits of a map as strangers to each other.
#[derive(Debug)]
pub(super) struct Strangers {
    /// The middle of the map, from which single precision tells fruits apart.
    middle: Vector3<f64>,
    tree: Tree,
    /// Typical distance to the sixth-nearest fruit, metres.
    spacing: f64,
    /// Looked up where a sighting asks.
    about: Vec<OnceLock<Box<About>>>,
}

/// A fruit of the map.
#[derive(Debug)]
struct About {
    kernels: [Matrix3<f64>; 2],
    /// Sum of the kernels at the other fruits.
    sum: f64,
}

impl Strangers {
    pub fn new(places: &[Vector3<f64>], spacing: f64) -> Self {
        let middle = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
        let points: Vec<_> = places.iter().map(|place| single(&(place - middle))).collect();
        Self { middle, tree: Tree::new(&points), spacing, about: places.iter().map(|_| OnceLock::new()).collect() }
    }

    /// Calls `visit` for the rows within `reach` of `place`.
    pub fn within(&self, place: &Vector3<f64>, reach: f64, mut visit: impl FnMut(usize)) {
        self.tree.within(&single(&(place - self.middle)), reach as f32, |row, _| visit(row as usize));
    }

    /// How many times as dense they are about the fruit `row` for a sighting of this covariance as for one that lies where it is seen.
    pub fn times(&self, places: &[Vector3<f64>], row: usize, covariance: &Matrix3<f64>) -> f64 {
        let about = self.about[row].get_or_init(|| {
            let kernels = kernels_among(&self.around(places, row), self.spacing);
            Box::new(About { kernels, sum: self.sum(places, row, &kernels) })
        });
        let smeared = self.sum(places, row, &about.kernels.map(|kernel| kernel + covariance));
        if about.sum > 0.0 && smeared > 0.0 { smeared / about.sum } else { 1.0 }
    }

    /// The nearest fruits about a fruit.
    fn around(&self, places: &[Vector3<f64>], row: usize) -> Vec<Vector3<f64>> {
        let mut nearest = Vec::new();
        self.tree.nearest(&single(&(places[row] - self.middle)), SEEN as usize + 1, &mut nearest);
        let others = nearest.into_iter().map(|(other, _)| other as usize).filter(|&other| other != row);
        others.map(|other| places[other] - places[row]).collect()
    }

    /// Sum of Gaussians of these covariances about a fruit over the other fruits, the wide one last.
    fn sum(&self, places: &[Vector3<f64>], row: usize, covariances: &[Matrix3<f64>; 2]) -> f64 {
        // No axis has more variance than the norm.
        let reach = RIM * covariances[1].norm().sqrt();
        let inverses = covariances.map(|covariance| covariance.try_inverse().unwrap_or_else(Matrix3::zeros));
        let peaks = inverses.map(|inverse| inverse.determinant().sqrt());
        let mut sum = 0.0;
        self.within(&places[row], reach.min(WIDEST_M), |other| {
            let apart = places[other] - places[row];
            for (inverse, peak) in inverses.iter().zip(peaks).filter(|_| other != row) {
                sum += peak * (-0.5 * apart.dot(&(inverse * apart))).exp();
            }
        });
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::shuffled;

    /// Fruits of a wall of 4 x 2 m that is so thick, metres, one of them in its middle.
    fn wall(thick: f64) -> Vec<Vector3<f64>> {
        let even = |k: u64| shuffled(k) as f64 / u64::MAX as f64;
        let normal = |k: u64| (0..12).map(|i| even(7919 * k + i)).sum::<f64>() - 6.0;
        let middle = Vector3::new(2.0, 0.0, 1.0);
        let fruit = |k: u64| Vector3::new(4.0 * even(3 * k), thick * normal(k), 2.0 * even(3 * k + 1));
        std::iter::once(middle).chain((1..400).map(fruit)).collect()
    }

    /// How many times as dense strangers are at the middle for a sighting with these standard deviations.
    fn times(places: &[Vector3<f64>], deviations: [f64; 3]) -> f64 {
        let covariance = Matrix3::from_diagonal(&Vector3::from(deviations).map(|one| one * one));
        Strangers::new(places, 0.17).times(places, 0, &covariance)
    }

    #[test]
    fn strangers_of_a_wall_are_as_much_thinner_as_the_depth_of_a_sighting_is_wider_than_the_wall() {
        let places = wall(0.05);
        assert!((times(&places, [0.001; 3]) - 1.0).abs() < 0.01);
        for depth in [0.1, 0.3] {
            // The kernel is as flat as the wall: that and the wall itself spread strangers without a sighting.
            let expected = (2.0 * 0.05f64.powi(2) / (2.0 * 0.05f64.powi(2) + depth * depth)).sqrt();
            let found = times(&places, [0.01, depth, 0.01]);
            assert!((found / expected).ln().abs() < 0.25, "{found} for {expected}");
        }
    }

    #[test]
    fn strangers_all_around_are_as_dense_however_badly_a_depth_is_known() {
        let found = times(&wall(1.0), [0.01, 0.3, 0.01]);
        assert!((0.6..1.5).contains(&found), "{found}");
    }

    #[test]
    fn a_fruit_alone_has_no_strangers() {
        assert!((times(&[Vector3::zeros()], [0.1; 3]) - 1.0).abs() < 1e-12);
    }
}
