//! A box that no known fruit explains becomes one.

use super::camera::{Camera, Pose};
use super::config::TrackingConfig;
use super::landmark::{Estimate, Size, symmetric};
use super::observation::{Lift, Observation};
use super::population::Population;
use nalgebra::{Matrix3, Vector3};

/// Scores are confidences of detectors, not probabilities: they are not trusted beyond these odds of 9 to 1.
const TRUSTED_SCORES: (f64, f64) = (0.1, 0.9);

/// What a box says about the fruit that it shows for the first time.
pub(crate) struct Birth {
    pub estimate: Estimate,
    /// Where it is if its depth is not the fruit's.
    pub doubt: Option<Estimate>,
    pub size: Size,
    /// Log-odds that it is a fruit.
    pub evidence: f64,
}

/// None where neither depth nor size says how far away it is.
pub(crate) fn birth(
    observation: &Observation,
    population: &Population,
    camera: &Camera,
    pose: &Pose,
    config: &TrackingConfig,
) -> Option<Birth> {
    let common = population.size();
    let by_size = common.and_then(|size| by_size(observation, size, camera, pose, config));
    let score = observation.score.clamp(TRUSTED_SCORES.0, TRUSTED_SCORES.1);
    let evidence = (config.new_per_frame / config.false_per_frame).ln() + (score / (1.0 - score)).ln();
    if let Some(lift) = &observation.lift {
        let mut size = common.unwrap_or(Size { ln_radius: lift.radius_m.ln(), variance: lift.radius_sigma.powi(2) });
        size.observe(lift, config);
        return Some(Birth { estimate: by_depth(lift, camera, pose), doubt: by_size, size, evidence });
    }
    Some(Birth { estimate: by_size?, doubt: None, size: common?, evidence })
}

fn by_depth(lift: &Lift, camera: &Camera, pose: &Pose) -> Estimate {
    in_session(&lift.seen, &lift.covariance, camera, pose)
}

/// As far away as a fruit of common size is that fills the longer side of the box: Z = R / (R / Z).
fn by_size(
    observation: &Observation,
    size: Size,
    camera: &Camera,
    pose: &Pose,
    config: &TrackingConfig,
) -> Option<Estimate> {
    let sides = &observation.sides;
    let whole = |axis: usize| sides[axis].whole().then(|| camera.middle_and_ratio(axis, sides[axis].edges).1);
    let ratio = [whole(0), whole(1)].into_iter().flatten().max_by(f64::total_cmp)?;
    let z = size.ln_radius.exp() / ratio;
    let edges = config.edge_sigma_px / (camera.focal_px[0] * ratio);
    let ln_z_variance = size.variance + config.hidden_mean.powi(2) + edges * edges / 2.0;
    let mut seen = Vector3::new(0.0, 0.0, z);
    let mut covariance = Matrix3::zeros();
    for axis in 0..2 {
        let (middle, variance) = middle(axis, observation, ratio, camera, config);
        seen[axis] = middle;
        covariance[(axis, axis)] = variance;
    }
    covariance[(2, 2)] = z * z * ln_z_variance;
    Some(in_session(&seen, &covariance, camera, pose))
}

/// Middle of the fruit along one axis and its variance, pixels: from both edges, or from the one that is in the picture.
fn middle(axis: usize, observation: &Observation, ratio: f64, camera: &Camera, config: &TrackingConfig) -> (f64, f64) {
    let side = &observation.sides[axis];
    let half = ratio * camera.focal_px[axis];
    let edge2 = config.edge_sigma_px.powi(2);
    if side.whole() {
        let lack = (half - side.edges.half()).max(0.0);
        return (camera.middle_and_ratio(axis, side.edges).0, edge2 / 2.0 + lack * lack / 3.0);
    }
    let middle = if side.cut[0] { side.edges.high - half } else { side.edges.low + half };
    (middle, edge2 + (config.hidden_mean * half).powi(2))
}

fn in_session(seen: &Vector3<f64>, covariance: &Matrix3<f64>, camera: &Camera, pose: &Pose) -> Estimate {
    let jacobian = camera.ray_jacobian(seen);
    Estimate {
        centre: pose.to_session(&camera.unproject(seen)),
        covariance: symmetric(&pose.covariance_to_session(&(jacobian * covariance * jacobian.transpose()))),
    }
}
