//! Log-odds that a box shows a known fruit, against a box that shows something new.
//!
//! With the predicted middle and depth m of covariance P, z of covariance C what depth says and (u, v) of covariance R the
//! middle of the box,
//!
//! ```text
//! p(box | fruit) = [ t N3(z - m; P + C) + w(z_Z) N2((u, v) - m; P + R) ] p(size | fruit)
//! ```
//!
//! where t is the probability that a depth is the fruit's and w the density of a wrong one ([`super::trust`]). A box
//! without depth has N2 alone. C and R grow by what the box lacks of the predicted outline: the hidden part may be on
//! either side, so the middle of what shows lies anywhere within half of it. An edge that the picture cuts says nothing;
//! then the other edge places the fruit.

use super::config::TrackingConfig;
use super::observation::{Observation, PixelSide};
use super::prediction::{Appearance, Prediction};
use super::unknown::{Conditions, NEW_LN_SIZES, Unknown};
use crate::camera::Camera;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use std::f64::consts::PI;

/// How far outlines of one fruit differ from those of a sphere, over its size.
const ROUNDNESS: f64 = 0.05;

/// Part of the boxes that are hidden at a side.
const HIDDEN: f64 = 0.5;

/// Standard deviations beyond which a box is not weighed: 1e-6 of a normal distribution.
const GATE: f64 = 5.0;

/// What a box says against what was predicted: observed less predicted, with the covariance of the observation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Residual {
    /// Middle of the box, pixels.
    pub across: (Vector2<f64>, Matrix2<f64>),
    /// Column, row (pixels) and depth (metres) that depth gives.
    pub lifted: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// Probability that the depth is the fruit's; 0 where there is none.
    pub depth_fits: f64,
    /// Log density of place, depth and size.
    pub log_density: f64,
}

/// A box weighed against a fruit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Weighed {
    /// Log-odds against something new.
    pub log_odds: f64,
    /// None where the box is out of the gate; then `doubt` is not.
    pub likely: Option<Residual>,
    pub doubt: Option<Residual>,
}

/// None where the box lies outside of the gates.
pub(crate) fn weigh(
    prediction: &Prediction,
    observation: &Observation,
    unknown: &Unknown,
    conditions: &Conditions<'_>,
) -> Option<Weighed> {
    let judge = |appearance: &Appearance| {
        let mut residual = residual(appearance, observation, unknown, conditions)?;
        residual.log_density +=
            size_log_density(appearance, prediction.ln_radius_variance, observation, conditions.config);
        Some(residual)
    };
    let likely = judge(&prediction.likely);
    let (doubt, log_odds) = match &prediction.doubt {
        Some((appearance, log_odds)) => (judge(appearance), *log_odds),
        None => (None, f64::INFINITY),
    };
    let density = |residual: &Option<Residual>| residual.as_ref().map_or(f64::NEG_INFINITY, |one| one.log_density);
    let weight = -(-log_odds).exp().ln_1p(); // ln of the probability of `likely`
    let log_density = log_sum(weight + density(&likely), weight - log_odds + density(&doubt));
    if log_density == f64::NEG_INFINITY {
        return None;
    }
    let found = conditions.config.detection_probability;
    let log_odds = log_density - unknown.log_density + (found / (1.0 - found)).ln();
    Some(Weighed { log_odds, likely, doubt })
}

fn residual(
    appearance: &Appearance,
    observation: &Observation,
    unknown: &Unknown,
    conditions: &Conditions<'_>,
) -> Option<Residual> {
    let Conditions { camera, config, .. } = conditions;
    let (mut value, mut noise, mut lack2) = (Vector2::zeros(), Matrix2::zeros(), Vector3::zeros());
    for axis in 0..2 {
        let along = along_axis(axis, appearance, &observation.sides[axis], camera, config);
        (value[axis], noise[(axis, axis)], lack2[axis]) = (along.value, along.variance + along.lack2, along.lack2);
    }
    let spread = Matrix2::from(appearance.covariance.fixed_view::<2, 2>(0, 0));
    let lifted = observation
        .lift
        .map(|lift| (lift.seen - appearance.seen, lift.covariance + Matrix3::from_diagonal(&lack2)))
        .filter(|(value, noise)| lies_in_gate(&value.xy(), &(spread + noise.fixed_view::<2, 2>(0, 0))));
    if lifted.is_none() && !lies_in_gate(&value, &(spread + noise)) {
        return None;
    }
    let across = log_normal2(&value, &(spread + noise));
    let (log_density, depth_fits) = match (&observation.lift, &unknown.trust) {
        (Some(lift), Some(trust)) => {
            let density =
                |(value, noise): (Vector3<f64>, Matrix3<f64>)| log_normal3(&value, &(appearance.covariance + noise));
            let fits = trust.fits.ln() + lifted.map_or(f64::NEG_INFINITY, density);
            let wrong = trust.wrong_density(lift.seen.z, appearance.seen.z).ln() + across;
            let either = log_sum(fits, wrong);
            (either, (fits - either).exp())
        }
        _ => (across, 0.0),
    };
    Some(Residual { across: (value, noise), lifted, depth_fits, log_density })
}

fn lies_in_gate(value: &Vector2<f64>, covariance: &Matrix2<f64>) -> bool {
    (0..2).all(|axis| value[axis].powi(2) <= GATE * GATE * covariance[(axis, axis)])
}

/// A box along one axis of the picture.
struct Along {
    /// Residual of its middle, or of its free edge, pixels.
    value: f64,
    variance: f64,
    /// What the hidden part adds to the variance.
    lack2: f64,
}

fn along_axis(
    axis: usize,
    appearance: &Appearance,
    side: &PixelSide,
    camera: &Camera,
    config: &TrackingConfig,
) -> Along {
    let predicted = appearance.outline[axis];
    let edge2 = config.edge_sigma_px.powi(2);
    match side.cut {
        [false, false] => {
            let value = side.middle - appearance.seen[axis];
            // The middle of what shows lies anywhere within half of what lacks: variance of a uniform distribution.
            let lack = (predicted.half() - side.edges.half()).max(0.0);
            Along { value, variance: edge2 / 2.0, lack2: lack * lack / 3.0 }
        }
        [true, true] => Along { value: 0.0, variance: camera.size_px()[axis].powi(2), lack2: 0.0 },
        [low_is_cut, _] => {
            let value = if low_is_cut { side.edges.high - predicted.high } else { side.edges.low - predicted.low };
            Along { value, variance: edge2 + (config.hidden_mean * predicted.half()).powi(2), lack2: 0.0 }
        }
    }
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
