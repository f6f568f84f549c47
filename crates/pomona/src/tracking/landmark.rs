//! A fruit that is known: where it is, how large, and what speaks for it.

use super::camera::{Camera, Pose};
use super::config::TrackingConfig;
use super::likelihood::Residual;
use super::observation::Lift;
use super::prediction::Appearance;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

/// Frames of which it is remembered whether they saw a fruit: more than a fruit stays in view at walking pace.
const REMEMBERED: u64 = 64;

/// A place with its covariance, in the session's frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Estimate {
    pub centre: Vector3<f64>,
    pub covariance: Matrix3<f64>,
}

/// The radius by its logarithm, because errors of outlines are in proportion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Size {
    pub ln_radius: f64,
    pub variance: f64,
}

/// One fruit.
#[derive(Debug, Clone)]
pub(crate) struct Landmark {
    pub estimate: Estimate,
    /// Where it is if the depth of its first box was a leaf's; dropped when a second box decides.
    pub doubt: Option<Estimate>,
    pub size: Size,
    pub views: usize,
    /// Frames of the tracker, not of the recording: the first is 0.
    pub last_seen: u64,
    /// Way of the camera when it was last seen, metres.
    pub last_way_m: f64,
    /// Log-odds that it is a fruit and not a false box.
    pub evidence: f64,
    /// Bit k is set when the frame `last_seen - k` saw it.
    seen_in: u64,
    /// The fruit that it turned out to be.
    pub merged_into: Option<usize>,
}

impl Landmark {
    pub fn born(estimate: Estimate, doubt: Option<Estimate>, size: Size, evidence: f64, now: u64, way_m: f64) -> Self {
        Self {
            estimate,
            doubt,
            size,
            views: 1,
            last_seen: now,
            last_way_m: way_m,
            evidence,
            seen_in: 1,
            merged_into: None,
        }
    }

    pub fn radius_m(&self) -> f64 {
        self.size.ln_radius.exp()
    }

    /// Notes that this frame saw it.
    pub fn hit(&mut self, now: u64, way_m: f64, evidence: f64) {
        self.seen_in = shifted(self.seen_in, now - self.last_seen) | 1;
        self.last_seen = now;
        self.last_way_m = way_m;
        self.views += 1;
        self.evidence += evidence;
    }

    /// Number of the remembered frames that saw both.
    pub fn frames_shared_with(&self, other: &Self) -> usize {
        let latest = self.last_seen.max(other.last_seen);
        let aligned = |one: &Self| shifted(one.seen_in, latest - one.last_seen);
        (aligned(self) & aligned(other)).count_ones() as usize
    }

    /// Takes over what another record of the same fruit knew.
    pub fn absorb(&mut self, other: &Self) {
        self.estimate = fused(&self.estimate, &other.estimate);
        self.doubt = None;
        self.size.add(other.size.ln_radius, other.size.variance);
        let latest = self.last_seen.max(other.last_seen);
        self.seen_in =
            shifted(self.seen_in, latest - self.last_seen) | shifted(other.seen_in, latest - other.last_seen);
        if other.last_seen > self.last_seen {
            self.last_way_m = other.last_way_m;
        }
        self.last_seen = latest;
        self.views += other.views;
        self.evidence += other.evidence;
    }
}

fn shifted(bits: u64, by: u64) -> u64 {
    if by < REMEMBERED { bits << by } else { 0 }
}

/// The product of two Gaussians.
pub(crate) fn fused(a: &Estimate, b: &Estimate) -> Estimate {
    let Some(inverse) = (a.covariance + b.covariance).try_inverse() else { return *a };
    let gain = a.covariance * inverse;
    let covariance = a.covariance - gain * a.covariance;
    Estimate { centre: a.centre + gain * (b.centre - a.centre), covariance: symmetric(&covariance) }
}

pub(crate) fn symmetric(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    (matrix + matrix.transpose()) / 2.0
}

impl Size {
    /// A Kalman step.
    pub fn add(&mut self, ln_radius: f64, variance: f64) {
        let gain = self.variance / (self.variance + variance);
        self.ln_radius += gain * (ln_radius - self.ln_radius);
        self.variance *= 1.0 - gain;
    }

    /// A step with a measured radius. Leaves make an outline smaller and never larger: what lacks may be hidden, what
    /// exceeds is noise of the outline alone.
    pub fn observe(&mut self, lift: &Lift, config: &TrackingConfig) {
        let ln_radius = lift.radius_m.ln();
        let mut variance = lift.radius_sigma.powi(2);
        if ln_radius < self.ln_radius {
            variance += config.hidden_mean.powi(2);
        }
        // Heavy tails: an outline around two fruits must not take the size along.
        let deviation2 = (ln_radius - self.ln_radius).powi(2) / (variance + self.variance);
        self.add(ln_radius, variance * (1.0 + deviation2));
    }
}

impl Estimate {
    /// A robust Kalman step with what one box showed.
    pub fn observe(&mut self, appearance: &Appearance, residual: &Residual, camera: &Camera, pose: &Pose) {
        let jacobian = camera.projection_jacobian(&appearance.in_camera) * pose.rotation.transpose();
        let step = if residual.depth_fits > 0.5 {
            self.step_with_depth(&jacobian, residual)
        } else {
            self.step_across(&jacobian, residual)
        };
        if let Some((centre, covariance)) = step {
            self.centre += centre;
            self.covariance = symmetric(&covariance);
        }
    }

    fn step_with_depth(&self, jacobian: &Matrix3<f64>, residual: &Residual) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let spread = jacobian * self.covariance * jacobian.transpose();
        let distance2 = residual.value.dot(&((spread + residual.noise).try_inverse()? * residual.value));
        // Cauchy's weight, as in the fusion of sightings: 3 is what the distance is on average.
        let noise = residual.noise * (1.0 + distance2 / 3.0);
        let gain = self.covariance * jacobian.transpose() * (spread + noise).try_inverse()?;
        Some((gain * residual.value, self.covariance - gain * jacobian * self.covariance))
    }

    fn step_across(&self, jacobian: &Matrix3<f64>, residual: &Residual) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let jacobian: Matrix2x3<f64> = jacobian.fixed_rows::<2>(0).into();
        let value: Vector2<f64> = residual.value.xy();
        let noise: Matrix2<f64> = residual.noise.fixed_view::<2, 2>(0, 0).into();
        let spread = jacobian * self.covariance * jacobian.transpose();
        let distance2 = value.dot(&((spread + noise).try_inverse()? * value));
        let gain = self.covariance * jacobian.transpose() * (spread + noise * (1.0 + distance2 / 2.0)).try_inverse()?;
        Some((gain * value, self.covariance - gain * jacobian * self.covariance))
    }
}
