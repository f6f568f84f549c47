//! A fruit that is known: where it is, how large, and what speaks for it.

use super::birth::Birth;
use super::config::TrackingConfig;
use super::known::Instant;
use super::likelihood::Residual;
use super::observation::Lift;
use super::prediction::Appearance;
use crate::camera::Camera;
use crate::pose::Pose;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

/// Frames of which it is remembered whether they saw a fruit: more than a fruit stays in view at walking pace.
const REMEMBERED: u64 = 64;

/// A place with its covariance, in the session's frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Estimate {
    pub centre: Vector3<f64>,
    pub covariance: Matrix3<f64>,
}

/// A place that a fruit may have instead of its estimate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Doubt {
    pub estimate: Estimate,
    /// Log-odds of the fruit's estimate against this one.
    pub log_odds: f64,
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
    /// Where it is otherwise: by its size or by the depth of its first box. Dropped when more boxes decide.
    pub doubt: Option<Doubt>,
    pub size: Size,
    pub views: usize,
    pub last_seen: Instant,
    /// Log-odds that it is a fruit and not a false box.
    pub evidence: f64,
    /// Frames that show it without a box, by number.
    pub glimpses: Vec<i64>,
    /// Bit k is set when the frame k before the last that saw it did so, too.
    seen_in: u64,
    /// The fruit that it turned out to be.
    pub merged_into: Option<usize>,
}

impl Landmark {
    /// Whether several frames say where it is, and nothing speaks for another place.
    pub fn is_placed(&self) -> bool {
        self.views >= 2 && self.doubt.is_none()
    }

    pub fn born(birth: Birth, now: Instant) -> Self {
        let Birth { estimate, doubt, size, evidence } = birth;
        Self {
            estimate,
            doubt,
            size,
            views: 1,
            last_seen: now,
            evidence,
            glimpses: Vec::new(),
            seen_in: 1,
            merged_into: None,
        }
    }

    pub fn radius_m(&self) -> f64 {
        self.size.ln_radius.exp()
    }

    /// Notes that this frame saw it.
    pub fn hit(&mut self, now: Instant, evidence: f64) {
        self.seen_in = shifted(self.seen_in, now.frame - self.last_seen.frame) | 1;
        self.last_seen = now;
        self.views += 1;
        self.evidence += evidence;
    }

    /// Number of the remembered frames that saw both.
    pub fn frames_shared_with(&self, other: &Self) -> usize {
        let latest = self.last_seen.frame.max(other.last_seen.frame);
        let aligned = |one: &Self| shifted(one.seen_in, latest - one.last_seen.frame);
        (aligned(self) & aligned(other)).count_ones() as usize
    }

    /// Takes over what another record of the same fruit knew.
    pub fn absorb(&mut self, other: &Self) {
        self.estimate = fused(&self.estimate, &other.estimate);
        self.doubt = None;
        self.size.add(other.size.ln_radius, other.size.variance);
        let [older, latest] =
            if self.last_seen.frame < other.last_seen.frame { [&*self, other] } else { [other, &*self] };
        let seen_in = latest.seen_in | shifted(older.seen_in, latest.last_seen.frame - older.last_seen.frame);
        (self.last_seen, self.seen_in) = (latest.last_seen, seen_in);
        self.views += other.views;
        self.evidence += other.evidence;
        self.glimpses.extend(&other.glimpses);
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
        let step = match &residual.lifted {
            Some((value, noise)) if residual.depth_fits > 0.5 => self.step_with_depth(&jacobian, value, noise),
            _ => self.step_across(&jacobian.fixed_rows::<2>(0).into(), &residual.across.0, &residual.across.1),
        };
        if let Some((centre, covariance)) = step {
            self.centre += centre;
            self.covariance = symmetric(&covariance);
        }
    }

    fn step_with_depth(
        &self,
        jacobian: &Matrix3<f64>,
        value: &Vector3<f64>,
        noise: &Matrix3<f64>,
    ) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let spread = jacobian * self.covariance * jacobian.transpose();
        let distance2 = value.dot(&((spread + noise).try_inverse()? * value));
        // Cauchy's weight, as in the fusion of sightings: 3 is what the distance is on average.
        let noise = noise * (1.0 + distance2 / 3.0);
        let gain = self.covariance * jacobian.transpose() * (spread + noise).try_inverse()?;
        Some((gain * value, self.covariance - gain * jacobian * self.covariance))
    }

    fn step_across(
        &self,
        jacobian: &Matrix2x3<f64>,
        value: &Vector2<f64>,
        noise: &Matrix2<f64>,
    ) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let spread = jacobian * self.covariance * jacobian.transpose();
        let distance2 = value.dot(&((spread + noise).try_inverse()? * value));
        let noise = noise * (1.0 + distance2 / 2.0);
        let gain = self.covariance * jacobian.transpose() * (spread + noise).try_inverse()?;
        Some((gain * value, self.covariance - gain * jacobian * self.covariance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_that_turns_out_to_be_the_same_fruit_brings_its_evidence() {
        let born = |evidence: f64| {
            let estimate = Estimate { centre: Vector3::zeros(), covariance: Matrix3::identity() };
            let size = Size { ln_radius: -3.0, variance: 0.1 };
            Landmark::born(Birth { estimate, doubt: None, size, evidence }, Instant::default())
        };
        let (mut one, mut other) = (born(2.5), born(-1.0));
        other.hit(Instant::default(), 0.25);
        one.absorb(&other);
        assert!((one.evidence - 1.75).abs() < 1e-12);
        assert_eq!(one.views, 3);
    }
}
