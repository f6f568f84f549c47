//! Fruits as the camera sees them.

use crate::cloud::FruitCloud;
use crate::pose::Pose;
use nalgebra::{Matrix3, Point3, Vector3};

/// Standard deviation of a sighting whose covariance nobody gave, metres per axis: that of orchards.
const USUAL_SIGMA_M: f64 = 0.02;

/// Standard deviation beyond which a place is hardly known, metres: the matcher takes fruits for points.
const SURE_M: f64 = 0.1;

/// One fruit seen once, in the frame of the camera as it is now.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sighting {
    pub place: Vector3<f64>,
    pub covariance: Matrix3<f64>,
    /// Row in the newest frame; `None` of older ones.
    pub row: Option<usize>,
    /// Motions since.
    pub age: usize,
    /// Its part of what is known of its fruit: one over how often the fruit was seen. A stranger that hangs near a fruit
    /// of the map does so in every frame.
    pub voice: f64,
}

impl Sighting {
    /// All fruits of a frame.
    pub fn of(seen: &FruitCloud) -> Vec<Self> {
        let one = |row: usize| Self {
            place: seen.positions[row].coords,
            covariance: covariance_of(seen, row),
            row: Some(row),
            age: 0,
            voice: 1.0,
        };
        (0..seen.len()).map(one).collect()
    }

    /// Whether its place is known well enough for a constellation.
    pub fn is_sure(&self) -> bool {
        self.covariance.trace() < SURE_M * SURE_M
    }

    /// The same from where the camera is now; `spread_m` is how surely the way is known.
    pub fn carried(&self, now_from_then: &Pose, age: usize, spread_m: f64) -> Self {
        let covariance = now_from_then.covariance_to_session(&self.covariance);
        Self {
            place: now_from_then.to_session(&self.place),
            covariance: covariance + Matrix3::identity() * (spread_m * spread_m),
            row: None,
            age,
            voice: self.voice,
        }
    }
}

/// Covariance of a fruit of a cloud, or the usual one.
pub(super) fn covariance_of(cloud: &FruitCloud, row: usize) -> Matrix3<f64> {
    let usual = || Matrix3::from_diagonal_element(USUAL_SIGMA_M * USUAL_SIGMA_M);
    cloud.covariances.as_ref().map_or_else(usual, |all| all[row])
}

/// A cloud of sightings.
pub(super) fn cloud_of(sightings: &[Sighting]) -> FruitCloud {
    FruitCloud {
        covariances: Some(sightings.iter().map(|one| one.covariance).collect()),
        ..FruitCloud::from_positions(sightings.iter().map(|one| Point3::from(one.place)).collect())
    }
}
