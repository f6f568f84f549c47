//! How a known fruit should look in a new frame.

use super::config::TrackingConfig;
use super::landmark::{Estimate, Landmark};
use super::sphere::Interval;
use crate::camera::Camera;
use crate::pose::Pose;
use nalgebra::{Matrix3, Vector3};

/// Part of the radius by which shape and leaves move the middle of an outline, alike in neighbouring frames, so that
/// no number of frames averages it out.
const SHAPE_SIGMA: f64 = 0.1;

/// A known fruit as the frame should show it.
#[derive(Debug, Clone)]
pub(crate) struct Prediction {
    /// Index of the fruit.
    pub landmark: usize,
    pub likely: Appearance,
    /// Where else it may be, and the log-odds of `likely` against that.
    pub doubt: Option<(Appearance, f64)>,
    /// Variance of the logarithm of the radius.
    pub ln_radius_variance: f64,
}

/// Where a fruit should appear.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Appearance {
    pub in_camera: Vector3<f64>,
    /// Column, row (pixels) and depth (metres) of the centre.
    pub seen: Vector3<f64>,
    /// Covariance of `seen`.
    pub covariance: Matrix3<f64>,
    pub outline: [Interval; 2],
}

/// The appearance of a fruit in a frame, None where it is out of the picture.
pub(crate) fn predict(
    index: usize,
    landmark: &Landmark,
    camera: &Camera,
    pose: &Pose,
    way_m: f64,
    config: &TrackingConfig,
) -> Option<Prediction> {
    let drift_m = config.drift_m((way_m - landmark.last_seen.way_m).abs());
    let place_variance = config.pose_sigma_m.powi(2) + drift_m.powi(2) + (SHAPE_SIGMA * landmark.radius_m()).powi(2);
    let appear = |estimate: &Estimate| appearance(estimate, landmark.radius_m(), place_variance, camera, pose, config);
    let doubt = landmark.doubt.as_ref().and_then(|doubt| Some((appear(&doubt.estimate)?, doubt.log_odds)));
    let likely = appear(&landmark.estimate)?;
    Some(Prediction { landmark: index, likely, doubt, ln_radius_variance: landmark.size.variance })
}

fn appearance(
    estimate: &Estimate,
    radius_m: f64,
    place_variance: f64,
    camera: &Camera,
    pose: &Pose,
    config: &TrackingConfig,
) -> Option<Appearance> {
    let in_camera = pose.to_camera(&estimate.centre);
    // Nearer than its diameter nothing is seen of a fruit but skin.
    if in_camera.z < 2.0 * radius_m {
        return None;
    }
    let jacobian = camera.projection_jacobian(&in_camera);
    let place = pose.covariance_to_camera(&estimate.covariance) + Matrix3::identity() * place_variance;
    let turn = |axis: usize| (camera.focal_px()[axis] * config.pose_sigma_rad).powi(2);
    let covariance =
        jacobian * place * jacobian.transpose() + Matrix3::from_diagonal(&Vector3::new(turn(0), turn(1), 0.0));
    let seen = camera.project(&in_camera);
    let outline = camera.outline(&in_camera, radius_m);
    let margin_px = outline[0].half() + 3.0 * covariance[(0, 0)].max(covariance[(1, 1)]).sqrt();
    camera.sees(&seen, margin_px).then_some(Appearance { in_camera, seen, covariance, outline })
}
