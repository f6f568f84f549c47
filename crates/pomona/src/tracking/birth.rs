//! A box that no known fruit explains becomes one.

use super::landmark::{Doubt, Estimate, Size, symmetric};
use super::observation::Observation;
use super::unknown::{Conditions, Unknown};
use crate::camera::Camera;
use crate::pose::Pose;
use nalgebra::{Matrix3, Vector3};

/// Scores are confidences of detectors, not probabilities: they are not trusted beyond these odds of 9 to 1.
const TRUSTED_SCORES: (f64, f64) = (0.1, 0.9);

/// What a box says about the fruit that it shows for the first time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Birth {
    pub estimate: Estimate,
    /// Where it is otherwise.
    pub doubt: Option<Doubt>,
    pub size: Size,
    /// Log-odds that it is a fruit.
    pub evidence: f64,
}

/// None where neither depth nor size says how far away it is.
pub(crate) fn birth(
    observation: &Observation,
    unknown: &Unknown,
    pose: &Pose,
    conditions: &Conditions<'_>,
) -> Option<Birth> {
    let Conditions { camera, config, .. } = conditions;
    let score = observation.score.clamp(TRUSTED_SCORES.0, TRUSTED_SCORES.1);
    let evidence = (config.new_per_frame / config.false_per_frame).ln() + (score / (1.0 - score)).ln();
    let place = |(seen, covariance): &(Vector3<f64>, Matrix3<f64>)| in_session(seen, covariance, camera, pose);
    let by_size = unknown.by_size.as_ref().map(place);
    let Some(lift) = &observation.lift else {
        return Some(Birth { estimate: by_size?, doubt: None, size: conditions.size?, evidence });
    };
    let by_depth = place(&(lift.seen, lift.covariance));
    let measured = Size { ln_radius: lift.radius_m.ln(), variance: lift.radius_sigma.powi(2) };
    let Some(by_size) = by_size else {
        return Some(Birth { estimate: by_depth, doubt: None, size: conditions.size.unwrap_or(measured), evidence });
    };
    let mut size = conditions.size?;
    let log_odds = (unknown.depth_fits / (1.0 - unknown.depth_fits)).ln();
    let (estimate, other) = if log_odds > 0.0 { (by_depth, by_size) } else { (by_size, by_depth) };
    if log_odds > 0.0 {
        size.observe(lift, config);
    }
    Some(Birth { estimate, doubt: Some(Doubt { estimate: other, log_odds: log_odds.abs() }), size, evidence })
}

fn in_session(seen: &Vector3<f64>, covariance: &Matrix3<f64>, camera: &Camera, pose: &Pose) -> Estimate {
    let jacobian = camera.ray_jacobian(seen);
    Estimate {
        centre: pose.to_session(&camera.unproject(seen)),
        covariance: symmetric(&pose.covariance_to_session(&(jacobian * covariance * jacobian.transpose()))),
    }
}
