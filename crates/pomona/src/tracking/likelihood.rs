//! Log-odds that a box shows a known fruit, against a box that shows something new.
//!
//! With the predicted middle and depth m of covariance P and what the box says, z of covariance R, S = P + R,
//!
//!     ln p(z | fruit) = ln[(1 - e) N3(z - m; S) + e N2(z - m; S) q(z_Z - m_Z)] + ln p(size | fruit)
//!
//! where e is the probability that the depth is not the fruit's and q its density then: mostly that of a leaf in front,
//! for nothing is seen through an apple. A box without depth has N2 alone. R grows by what the box lacks of the predicted
//! outline: a part that hides may be on either side, so the middle of what shows lies anywhere within half of it. An edge
//! that the picture cuts says nothing; then the other edge places the fruit.

use super::camera::Camera;
use super::config::TrackingConfig;
use super::observation::{Observation, Side};
use super::prediction::{Appearance, Prediction};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use std::f64::consts::PI;

/// Wrong depths: part that is nearer than the fruit, its mean distance, that of the others, metres. Of the rendered row's
/// 12 wrong ones of 2,700, 11 are a leaf's, 3 to 30 cm in front.
const NEARER: f64 = 0.9;
const LEAF_AHEAD_M: f64 = 0.2;
const GAP_BEHIND_M: f64 = 0.5;

/// Depths over which new fruits are spread, metres, and logarithms of sizes.
const NEW_DEPTHS_M: f64 = 2.0;
const NEW_LN_SIZES: f64 = 1.5;

/// How far outlines of one fruit differ from those of a sphere, over its size.
const ROUNDNESS: f64 = 0.05;

/// Part of the boxes that are hidden at a side.
const HIDDEN: f64 = 0.5;

/// Standard deviations beyond which a box is not weighed: 1e-6 of a normal distribution.
const GATE: f64 = 5.0;

/// What a box says against what was predicted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Residual {
    /// Column, row (pixels), depth (metres): observed less predicted; 0 where the box is silent.
    pub value: Vector3<f64>,
    /// Covariance of the observation.
    pub noise: Matrix3<f64>,
    /// Probability that the depth is the fruit's; 0 where there is none.
    pub depth_fits: f64,
    /// Log density of place and depth.
    pub log_density: f64,
}

/// A box weighed against a fruit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Weighed {
    /// Log-odds against something new.
    pub log_odds: f64,
    pub likely: Residual,
    pub doubt: Option<Residual>,
}

/// None where the box lies outside of the gate.
pub(crate) fn weigh(
    prediction: &Prediction,
    observation: &Observation,
    camera: &Camera,
    config: &TrackingConfig,
) -> Option<Weighed> {
    let judge = |appearance: &Appearance| {
        let residual = residual(appearance, observation, camera, config)?;
        let size = size_log_density(appearance, prediction.ln_radius_variance, observation, config);
        Some((residual, residual.log_density + size))
    };
    let likely = judge(&prediction.likely);
    let doubt = prediction.doubt.as_ref().and_then(judge);
    let wrong = config.depth_outliers;
    let log_density = match (likely, doubt) {
        (Some((_, a)), Some((_, b))) => log_sum((1.0 - wrong).ln() + a, wrong.ln() + b),
        (Some((_, a)), None) => a,
        (None, Some((_, b))) => wrong.ln() + b,
        (None, None) => return None,
    };
    let log_odds = log_density - something_new(observation, camera, config) + odds_of_detection(config);
    let likely = likely.map_or_else(out_of_gate, |found| found.0);
    Some(Weighed { log_odds, likely, doubt: doubt.map(|found| found.0) })
}

fn odds_of_detection(config: &TrackingConfig) -> f64 {
    (config.detection_probability / (1.0 - config.detection_probability)).ln()
}

/// A residual that no estimate takes up.
fn out_of_gate() -> Residual {
    Residual { value: Vector3::zeros(), noise: Matrix3::identity(), depth_fits: 0.0, log_density: f64::NEG_INFINITY }
}

/// Log density of a box that shows no known fruit: anywhere in the picture, at any depth, of any size.
pub(crate) fn something_new(observation: &Observation, camera: &Camera, config: &TrackingConfig) -> f64 {
    let [width, height] = camera.size_px;
    let per_picture = (config.new_per_frame + config.false_per_frame) / (width * height);
    let depths = if observation.lift.is_some() { NEW_DEPTHS_M } else { 1.0 };
    (per_picture / depths / NEW_LN_SIZES).ln()
}

fn residual(
    appearance: &Appearance,
    observation: &Observation,
    camera: &Camera,
    config: &TrackingConfig,
) -> Option<Residual> {
    let mut value = Vector3::zeros();
    let mut noise = Matrix3::zeros();
    if let Some(lift) = &observation.lift {
        value = lift.seen - appearance.seen;
        noise = lift.covariance;
    }
    for axis in 0..2 {
        let (across, variance, slack2) = along_axis(axis, appearance, &observation.sides[axis], camera, config);
        if observation.lift.is_none() {
            value[axis] = across;
            noise[(axis, axis)] = variance;
        }
        noise[(axis, axis)] += slack2;
        if value[axis].powi(2) > GATE * GATE * (noise[(axis, axis)] + appearance.covariance[(axis, axis)]) {
            return None;
        }
    }
    let (log_density, depth_fits) = log_density(&value, &(appearance.covariance + noise), observation, config);
    Some(Residual { value, noise, depth_fits, log_density })
}

/// Residual of a box along one axis of the picture, its variance, and what the hidden part adds to it.
fn along_axis(
    axis: usize,
    appearance: &Appearance,
    side: &Side,
    camera: &Camera,
    config: &TrackingConfig,
) -> (f64, f64, f64) {
    let predicted = appearance.outline[axis];
    let edge2 = config.edge_sigma_px.powi(2);
    // The middle of what shows lies anywhere within half of what lacks: variance of a uniform distribution.
    let lack = (predicted.half() - side.edges.half()).max(0.0);
    match side.cut {
        [false, false] => {
            (camera.middle_and_ratio(axis, side.edges).0 - appearance.seen[axis], edge2 / 2.0, lack * lack / 3.0)
        }
        [true, true] => (0.0, camera.size_px[axis].powi(2), 0.0),
        [low_is_cut, _] => {
            let free = if low_is_cut { side.edges.high - predicted.high } else { side.edges.low - predicted.low };
            let hidden = config.hidden_mean * predicted.half();
            (free, edge2 + hidden * hidden, 0.0)
        }
    }
}

/// Log density of a residual, and the probability that its depth is the fruit's.
fn log_density(
    value: &Vector3<f64>,
    covariance: &Matrix3<f64>,
    observation: &Observation,
    config: &TrackingConfig,
) -> (f64, f64) {
    let across = log_normal2(&value.xy(), &covariance.fixed_view::<2, 2>(0, 0).into());
    if observation.lift.is_none() {
        return (across, 0.0);
    }
    let wrong = config.depth_outliers;
    let fits = (1.0 - wrong).ln() + log_normal3(value, covariance);
    let (part, mean_m) = if value.z < 0.0 { (NEARER, LEAF_AHEAD_M) } else { (1.0 - NEARER, GAP_BEHIND_M) };
    let fails = (wrong * part / mean_m).ln() - value.z.abs() / mean_m + across;
    let either = log_sum(fits, fails);
    (either, (fits - either).exp())
}

/// Log density of the logarithm of the box's longer side, over that of the predicted outline: equal up to noise where
/// nothing hides it, else less.
fn size_log_density(
    appearance: &Appearance,
    ln_radius_variance: f64,
    observation: &Observation,
    config: &TrackingConfig,
) -> f64 {
    let ratios = (0..2)
        .filter(|&axis| observation.sides[axis].whole())
        .map(|axis| (observation.sides[axis].edges.half(), appearance.outline[axis].half()));
    let Some((seen, predicted)) = ratios.max_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1))) else {
        return -NEW_LN_SIZES.ln(); // says nothing
    };
    let depth_variance = appearance.covariance[(2, 2)] / appearance.seen.z.powi(2);
    let edges = config.edge_sigma_px.powi(2) / (2.0 * predicted * predicted);
    let sigma = (ln_radius_variance + depth_variance + edges + ROUNDNESS * ROUNDNESS).sqrt();
    one_sided((seen / predicted).ln(), sigma, config.hidden_mean)
}

/// Log density of noise, or of noise less an exponentially distributed part that hides.
fn one_sided(deviation: f64, sigma: f64, mean: f64) -> f64 {
    let normal = (-0.5 * (deviation / sigma).powi(2)).exp() / (sigma * (2.0 * PI).sqrt());
    // Convolution of both, its Gaussian edge as a logistic one (within 2 % of the normal distribution's).
    let edge = 1.0 / (1.0 + (1.702 * (deviation / sigma + sigma / mean)).exp());
    let hidden = (deviation / mean + 0.5 * (sigma / mean).powi(2)).exp() / mean * edge;
    ((1.0 - HIDDEN) * normal + HIDDEN * hidden).max(f64::MIN_POSITIVE).ln()
}

fn log_normal2(value: &Vector2<f64>, covariance: &Matrix2<f64>) -> f64 {
    let Some(inverse) = covariance.try_inverse() else { return f64::NEG_INFINITY };
    -0.5 * (value.dot(&(inverse * value)) + ((2.0 * PI).powi(2) * covariance.determinant()).ln())
}

fn log_normal3(value: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
    let Some(inverse) = covariance.try_inverse() else { return f64::NEG_INFINITY };
    -0.5 * (value.dot(&(inverse * value)) + ((2.0 * PI).powi(3) * covariance.determinant()).ln())
}

fn log_sum(a: f64, b: f64) -> f64 {
    let larger = a.max(b);
    if larger == f64::NEG_INFINITY { larger } else { larger + ((a - larger).exp() + (b - larger).exp()).ln() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_of_size_integrate_to_one() {
        let step = 1e-3;
        let total: f64 = (-4000..2000).map(|k| one_sided(f64::from(k) * step, 0.1, 0.2).exp() * step).sum();
        assert!((total - 1.0).abs() < 0.02, "{total}");
    }

    #[test]
    fn smaller_is_likelier_than_larger() {
        assert!(one_sided(-0.4, 0.1, 0.2) > one_sided(0.4, 0.1, 0.2) + 3.0);
    }
}
