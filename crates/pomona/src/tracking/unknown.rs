//! A box by itself: what it would be if it showed something new.

use super::config::TrackingConfig;
use super::landmark::Size;
use super::observation::Observation;
use super::trust::{Reliability, Trust};
use crate::camera::Camera;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Depths over which new fruits are spread while no size is known, metres.
const NEW_DEPTHS_M: f64 = 2.0;

/// Logarithms of sizes over which new boxes are spread.
pub(crate) const NEW_LN_SIZES: f64 = 1.5;

/// What is known apart from single fruits.
#[derive(Clone, Copy)]
pub(crate) struct Conditions<'a> {
    pub camera: &'a Camera,
    pub config: &'a TrackingConfig,
    /// Size of the fruits of this visit.
    pub size: Option<Size>,
    pub reliability: &'a Reliability,
}

/// A box that shows something new.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Unknown {
    /// Column, row (pixels) and depth (metres) of a fruit of common size in this box, and their covariance.
    pub by_size: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// What the depth of the box is, before it is looked at.
    pub trust: Option<Trust>,
    /// Probability that the depth is the fruit's, by the size that it gives it.
    pub depth_fits: f64,
    /// Log density of the box.
    pub log_density: f64,
}

/// New boxes lie anywhere in the picture, have any size, and the depth that fruits of common size have, or a wrong one.
pub(crate) fn unknown(observation: &Observation, conditions: &Conditions<'_>) -> Unknown {
    let Conditions { camera, config, .. } = conditions;
    let [width, height] = camera.size_px();
    let anywhere = ((config.new_per_frame + config.false_per_frame) / (width * height) / NEW_LN_SIZES).ln();
    let by_size = conditions.size.and_then(|size| by_size(observation, size, camera, config));
    let Some(lift) = &observation.lift else {
        return Unknown { by_size, trust: None, depth_fits: 0.0, log_density: anywhere };
    };
    let trust = conditions.reliability.trust(lift.support);
    let (fits, wrong) = match &by_size {
        Some((seen, covariance)) => {
            let common = log_normal_density(lift.seen.z, seen.z, covariance[(2, 2)].sqrt() / seen.z);
            (trust.fits * common, trust.wrong_density(lift.seen.z, seen.z))
        }
        None => (trust.fits / NEW_DEPTHS_M, (1.0 - trust.fits) / NEW_DEPTHS_M),
    };
    let either = (fits + wrong).max(f64::MIN_POSITIVE);
    Unknown { by_size, trust: Some(trust), depth_fits: fits / either, log_density: anywhere + either.ln() }
}

fn log_normal_density(value: f64, median: f64, sigma: f64) -> f64 {
    let deviation = (value / median).ln() / sigma;
    (-0.5 * deviation * deviation).exp() / (sigma * value * (2.0 * PI).sqrt())
}

/// As far away as a fruit of common size is that fills the longer side of the box: Z = R / (R / Z).
fn by_size(
    observation: &Observation,
    size: Size,
    camera: &Camera,
    config: &TrackingConfig,
) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let sides = &observation.sides;
    let whole = |axis: usize| sides[axis].whole().then_some(sides[axis].ratio);
    let ratio = [whole(0), whole(1)].into_iter().flatten().max_by(f64::total_cmp)?;
    let z = size.ln_radius.exp() / ratio;
    let edges = config.edge_sigma_px / (camera.fx * ratio);
    let ln_z_variance = size.variance + config.hidden_mean.powi(2) + edges * edges / 2.0;
    let mut seen = Vector3::new(0.0, 0.0, z);
    let mut covariance = Matrix3::zeros();
    for axis in 0..2 {
        let (middle, variance) = middle(axis, observation, ratio, camera, config);
        seen[axis] = middle;
        covariance[(axis, axis)] = variance;
    }
    covariance[(2, 2)] = z * z * ln_z_variance;
    Some((seen, covariance))
}

/// Middle of the fruit along one axis and its variance, pixels: from both edges, or from the one that is in the picture.
fn middle(axis: usize, observation: &Observation, ratio: f64, camera: &Camera, config: &TrackingConfig) -> (f64, f64) {
    let side = &observation.sides[axis];
    let half = ratio * camera.focal_px()[axis];
    let edge2 = config.edge_sigma_px.powi(2);
    if side.whole() {
        let lack = (half - side.edges.half()).max(0.0);
        return (side.middle, edge2 / 2.0 + lack * lack / 3.0);
    }
    let middle = if side.cut[0] { side.edges.high - half } else { side.edges.low + half };
    (middle, edge2 + (config.hidden_mean * half).powi(2))
}
