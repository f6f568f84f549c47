//! The map's fruits, asked by place.

use super::sightings::covariance_of;
use super::strangers::{Strangers, WIDEST_M};
use crate::cloud::FruitCloud;
use crate::matching::MapIndex;
use crate::neighbours::vicinity::Vicinity;
use nalgebra::{Matrix3, Vector3};

/// Distance up to which a sighting may show a fruit, metres: three times the depth's standard deviation at 3 m.
const REACH_M: f64 = 0.25;

/// The same of one that is known worse, in its own standard deviations.
const REACH: f64 = 3.0;

#[derive(Debug)]
pub(super) struct KnownFruits {
    pub places: Vec<Vector3<f64>>,
    /// Covariance of each, its own movement since the map included.
    pub covariances: Vec<Matrix3<f64>>,
    /// Strangers in a cubic metre about each, as the matcher has them ([`MapIndex::densities`]).
    pub densities: Vec<f64>,
    vicinity: Vicinity,
    strangers: Strangers,
}

impl KnownFruits {
    pub fn new(map: &FruitCloud, index: &MapIndex, own_m: f64) -> Self {
        let places: Vec<_> = map.positions.iter().map(|place| place.coords).collect();
        let moved = Matrix3::from_diagonal_element(own_m * own_m);
        Self {
            vicinity: Vicinity::new(&places, REACH_M),
            covariances: (0..places.len()).map(|row| covariance_of(map, row) + moved).collect(),
            densities: index.densities(),
            strangers: Strangers::new(&places, index.spacing()),
            places,
        }
    }

    /// Rows of the fruits that a sighting at `place` may show.
    pub fn near(&self, place: &Vector3<f64>) -> impl Iterator<Item = usize> {
        let rows = self.vicinity.of(place).iter().map(|&row| row as usize);
        rows.filter(move |&row| (self.places[row] - place).norm_squared() < REACH_M * REACH_M)
    }

    /// A fruit as what a sighting at `place` shows, whose covariance is `own` and whose strangers are `times` as dense as those of the map.
    pub fn candidate(&self, row: usize, place: &Vector3<f64>, own: &Matrix3<f64>, times: f64) -> Option<Candidate> {
        let covariance = own + self.covariances[row];
        let inverse = covariance.try_inverse()?;
        let error = self.places[row] - place;
        let squared = error.dot(&(inverse * error));
        let peak = (2.0 * std::f64::consts::PI).powi(3) * covariance.determinant();
        let ratio = (-0.5 * squared).exp() / (peak.sqrt() * self.densities[row] * times);
        Some(Candidate { row, error, inverse, ratio, squared })
    }

    /// Densities of a sighting at `place`, whose covariance is `own`, where it shows each fruit, over those of the strangers there, in all.
    pub fn likelihood(&self, place: &Vector3<f64>, own: &Matrix3<f64>) -> f64 {
        self.within_reach(place, own)
            .into_iter()
            .filter_map(|row| self.candidate(row, place, own, 1.0))
            .map(|one| one.ratio)
            .sum()
    }

    /// How many times as dense strangers are for a sighting at `place` with this covariance as for one that lies where it is seen.
    pub fn times(&self, place: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
        let candidates = self
            .within_reach(place, covariance)
            .into_iter()
            .filter_map(|row| self.candidate(row, place, covariance, 1.0));
        let nearest = candidates.min_by(|one, other| one.squared.total_cmp(&other.squared));
        nearest.map_or(1.0, |one| self.strangers.times(&self.places, one.row, covariance))
    }

    /// Rows of all fruits that a sighting may show.
    fn within_reach(&self, place: &Vector3<f64>, covariance: &Matrix3<f64>) -> Vec<usize> {
        // No axis has more variance than the norm.
        let reach = REACH * covariance.norm().sqrt();
        if reach <= REACH_M {
            return self.near(place).collect();
        }
        let mut rows = Vec::new();
        self.strangers.within(place, reach.min(WIDEST_M), |row| rows.push(row));
        rows.sort_unstable();
        rows
    }
}

/// A fruit of the map that a sighting may show, and how well it explains it.
pub(super) struct Candidate {
    pub row: usize,
    /// From where the sighting lies to the fruit.
    pub error: Vector3<f64>,
    pub inverse: Matrix3<f64>,
    /// Density N of the error over that of strangers.
    pub ratio: f64,
    /// Squared Mahalanobis distance.
    pub squared: f64,
}
