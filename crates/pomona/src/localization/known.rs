//! The map's fruits, asked by place.

use super::sightings::covariance_of;
use crate::cloud::FruitCloud;
use crate::matching::MapIndex;
use crate::neighbours::vicinity::Vicinity;
use nalgebra::{Matrix3, Vector3};

/// Distance up to which a sighting may show a fruit, metres: three times the depth's standard deviation at 3 m.
const REACH_M: f64 = 0.25;

#[derive(Debug)]
pub(super) struct KnownFruits {
    pub places: Vec<Vector3<f64>>,
    /// Covariance of each, its own movement since the map included.
    pub covariances: Vec<Matrix3<f64>>,
    /// Strangers in a cubic metre about each, as the matcher has them ([`MapIndex::densities`]).
    pub densities: Vec<f64>,
    vicinity: Vicinity,
}

impl KnownFruits {
    pub fn new(map: &FruitCloud, index: &MapIndex, own_m: f64) -> Self {
        let places: Vec<_> = map.positions.iter().map(|place| place.coords).collect();
        let moved = Matrix3::from_diagonal_element(own_m * own_m);
        Self {
            vicinity: Vicinity::new(&places, REACH_M),
            covariances: (0..places.len()).map(|row| covariance_of(map, row) + moved).collect(),
            densities: index.densities(),
            places,
        }
    }

    /// Rows of the fruits that a sighting at `place` may show.
    pub fn near(&self, place: &Vector3<f64>) -> impl Iterator<Item = usize> {
        let rows = self.vicinity.of(place).iter().map(|&row| row as usize);
        rows.filter(move |&row| (self.places[row] - place).norm_squared() < REACH_M * REACH_M)
    }
}
