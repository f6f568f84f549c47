//! How surely a pose is known when fruits do not err independently.
//!
//! The pose is a weighted mean of what n sightings say, with gains G = H^-1 J^T W. Independent errors average out and leave
//! phi H^-1. Errors that they share do not: the covariance is `phi H^-1 + H^-1 (sum over i, k of U_i C_ik U_k^T) H^-1` with
//! `U = J^T W`, and `C_ik = a^2 + b^2 exp(-d^2 / 2 r^2)` of two sightings d apart; two sightings of one fruit also share
//! where it hangs.
//!
//! What a frame saw before a motion lies off by what that motion errs by, with all frames before: Q of each motion is in C
//! of all pairs that are older.
//!
//! a is what all in view share: branches that grow heavy sink together. The pose takes it up, so that no residual shows
//! it, and somebody has to say it; across the vertical, where that is known, it is less. b is what only neighbours share; their
//! residuals show it, and phi, by how much sightings err more or less than their covariances say (`residuals`).

use super::alignment::{Aligned, Joint, Say, UNKNOWNS};
use super::config::LocalizationConfig;
use super::known::KnownFruits;
use super::residuals::{Shown, kinship, shown};
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3};

/// How far fruits hang from where the map has them together.
pub(super) struct Sag {
    /// Covariance of what all in view share, square metres.
    all: Matrix3<f64>,
    reach_m: f64,
}

impl Sag {
    /// `up` is the vertical in the map: branches sink, and move little aside.
    pub fn new(config: &LocalizationConfig, up: Option<Vector3<f64>>) -> Self {
        let whole = config.shared_m * config.shared_m;
        let aside = whole * config.sideways * config.sideways;
        let upright = |up: Vector3<f64>| {
            let up = up.normalize();
            Matrix3::from_diagonal_element(aside) + up * up.transpose() * (whole - aside)
        };
        Self { all: up.map_or_else(|| Matrix3::from_diagonal_element(whole), upright), reach_m: config.reach_m }
    }
}

/// Covariance of the pose's step and of the slip.
pub(super) fn covariance(aligned: &Aligned, map: &KnownFruits, way: &[Matrix6<f64>], sag: &Sag) -> Option<Joint> {
    let alone = aligned.information.cholesky()?.inverse();
    let Shown { scale, near } = shown(aligned, &alone, sag.reach_m);
    let errors = Shared {
        together: sag.all,
        near: Matrix3::from_diagonal_element(near),
        own: scale.min(1.0),
        reach_m: sag.reach_m,
    };
    let pulls: Vec<Pull> = aligned.says.iter().map(|say| (say, say.slopes.transpose() * say.information)).collect();
    let mut middle = Joint::zeros();
    for (i, (one, pull)) in pulls.iter().enumerate() {
        let mut sum = (errors.together + errors.near) * 0.5 * pull.transpose();
        for (other, its) in &pulls[i + 1..] {
            sum += errors.common(one, other, map) * its.transpose();
        }
        let half = pull * sum;
        middle += half + half.transpose();
    }
    for (before, motion) in way.iter().enumerate() {
        middle += of_motion(&pulls, before, motion);
    }
    Some(alone * scale + alone * middle * alone)
}

/// What the frames before a motion err by together, `after` being the motions after it.
fn of_motion(pulls: &[Pull], after: usize, covariance: &Matrix6<f64>) -> Joint {
    let older = pulls.iter().filter(|(say, _)| say.age > after);
    let gain = older
        .fold(SMatrix::<f64, UNKNOWNS, 6>::zeros(), |sum, (say, pull)| sum + pull * say.slopes.fixed_columns::<6>(0));
    gain * covariance * gain.transpose()
}

/// A sighting, and `U`.
type Pull<'a> = (&'a Say, SMatrix<f64, UNKNOWNS, 3>);

/// What sightings err by together, square metres.
struct Shared {
    /// All in view.
    together: Matrix3<f64>,
    /// Those that are within `reach_m`, besides.
    near: Matrix3<f64>,
    /// Two sightings of one fruit, of where it hangs: part of its covariance. No more than sightings are said to err by
    /// alone, or the sum is no covariance.
    own: f64,
    reach_m: f64,
}

impl Shared {
    /// Covariance of the errors of two sightings with each other.
    fn common(&self, one: &Say, other: &Say, map: &KnownFruits) -> Matrix3<f64> {
        let shared = self.together + self.near * kinship(one, other, self.reach_m);
        match (one.best, other.best) {
            (Some(row), Some(same)) if row == same => shared + map.covariances[row] * self.own,
            _ => shared,
        }
    }
}
