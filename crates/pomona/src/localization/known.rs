//! The map's fruits, asked by place.

use super::sightings::covariance_of;
use crate::cloud::FruitCloud;
use crate::neighbours::vicinity::Vicinity;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Distance up to which a sighting may show a fruit, metres: three times the depth's standard deviation at 3 m.
const REACH_M: f64 = 0.25;

/// Fruits that are counted more than there are within that reach, so that no place is thought empty for sure.
const LEAST_COUNT: f64 = 0.5;

#[derive(Debug)]
pub(super) struct KnownFruits {
    pub places: Vec<Vector3<f64>>,
    /// Covariance of each, its own movement since the map included.
    pub covariances: Vec<Matrix3<f64>>,
    vicinity: Vicinity,
}

impl KnownFruits {
    pub fn new(map: &FruitCloud, own_m: f64) -> Self {
        let places: Vec<_> = map.positions.iter().map(|place| place.coords).collect();
        let moved = Matrix3::from_diagonal_element(own_m * own_m);
        Self {
            vicinity: Vicinity::new(&places, REACH_M),
            covariances: (0..places.len()).map(|row| covariance_of(map, row) + moved).collect(),
            places,
        }
    }

    /// Rows of the fruits that a sighting at `place` may show.
    pub fn near(&self, place: &Vector3<f64>) -> impl Iterator<Item = usize> {
        let rows = self.vicinity.of(place).iter().map(|&row| row as usize);
        rows.filter(move |&row| (self.places[row] - place).norm_squared() < REACH_M * REACH_M)
    }

    /// Fruits per cubic metre around a place with `count` fruits within reach.
    pub fn density(count: usize) -> f64 {
        (count as f64 + LEAST_COUNT) / (4.0 / 3.0 * PI * REACH_M.powi(3))
    }
}
