//! Told motions that fall short alike.
//!
//! The window holds the frames before where the told motions have them. If each of the last m motions falls short by the
//! same step, as where a scale is wrong or a wheel slips, a frame a motions ago lies off by the part min(a, m) / m of
//! what they fall short by together, the slip D: a step of the camera, normal with a covariance B before anyone looks.
//! It is settled together with the pose (`alignment`), and by Laplace's rule
//!
//! ln p = L - D^T B^-1 D / 2 - ln det B / 2 - ln det H / 2
//!
//! is what the sightings say for both, H being their information: more unknowns fit more, and det H takes that off.

use super::alignment::{Aligned, Joint, UNKNOWNS};
use super::belief::Belief;
use super::sightings::Sighting;
use crate::bundle::steps::moved;
use crate::pose::Pose;
use nalgebra::{Matrix3x6, Matrix6, SMatrix, Vector3, Vector6};

/// What a slip amounts to before anyone notices: standard deviation per axis, metres and radians.
const UNNOTICED: (f64, f64) = (0.08, 0.03);

#[derive(Debug, Clone, Copy)]
pub(super) struct Slip {
    /// Motions that fall short, the last one among them; 0: none does.
    since: usize,
    /// By what all of them do together.
    total: Vector6<f64>,
    /// Its covariance as it is known so far.
    covariance: Matrix6<f64>,
    /// B.
    expected: Matrix6<f64>,
}

impl Slip {
    /// Motions as they were told.
    pub fn none() -> Self {
        let sure = Matrix6::zeros();
        Self { since: 0, total: Vector6::zeros(), covariance: sure, expected: unnoticed() }
    }

    /// Of the last motions, by nobody knows what.
    pub fn of_last(since: usize) -> Self {
        Self { since, covariance: unnoticed(), ..Self::none() }
    }

    /// Of the last motions, by chance: together they err with this covariance.
    pub fn by_chance(since: usize, covariance: &Matrix6<f64>) -> Self {
        Self { since, total: Vector6::zeros(), covariance: *covariance, expected: *covariance }
    }

    /// Others that chance may have made of it, to look from there: a standard deviation either way along each axis, each known to
    /// half of one.
    pub fn others(&self) -> impl Iterator<Item = Self> + '_ {
        let sigmas = self.expected.diagonal().map(f64::sqrt);
        let aside = move |axis: usize, sign: f64| {
            let mut total = Vector6::zeros();
            total[axis] = sign * sigmas[axis];
            Self { total, covariance: self.expected * 0.25, ..*self }
        };
        (0..6).flat_map(move |axis| [-1.0, 1.0].map(|sign| aside(axis, sign)))
    }

    /// What is not known of it once it is taken off: a slip of the next motion.
    pub fn left(&self) -> Self {
        let part = self.part(1);
        let covariance = self.covariance * (part * part);
        Self { since: 1, total: Vector6::zeros(), covariance, expected: covariance }
    }

    /// The same, one motion later.
    pub fn later(&self) -> Self {
        let longer = (self.since + 1) as f64 / self.since as f64;
        let larger = longer * longer;
        Self {
            since: self.since + 1,
            total: self.total * longer,
            covariance: self.covariance * larger,
            expected: self.expected * larger,
        }
    }

    /// As it was settled, `covariance` being that of pose and slip.
    pub fn known(&self, covariance: &Joint) -> Self {
        Self { covariance: covariance.fixed_view::<6, 6>(6, 6).into_owned(), ..*self }
    }

    pub fn motions(&self) -> usize {
        self.since
    }

    pub fn step(&mut self, more: &Vector6<f64>) {
        self.total += more;
    }

    /// By what one motion falls short.
    pub fn of_a_motion(&self) -> Vector6<f64> {
        self.total * self.part(1)
    }

    /// Where the camera is expected that `told` has elsewhere. What is not known of the slip errs alike in all its motions:
    /// n of them are off by n^2 times the variance of one, to which the last adds 2 n - 1.
    pub fn ahead(&self, told: &Belief) -> Belief {
        let part = self.part(1);
        Belief {
            pose: moved(&told.pose, &self.of_a_motion()),
            covariance: told.covariance + self.covariance * (part * (2.0 - part)),
            motion: told.motion,
        }
    }

    /// From where a frame `age` motions ago is told to lie to where it lies, both from the camera.
    pub fn since(&self, age: usize) -> Pose {
        moved(&Pose::IDENTITY, &(-self.total * self.part(age)))
    }

    /// Where a sighting lies from the camera.
    pub fn corrected(&self, seen: &Sighting) -> Vector3<f64> {
        if self.part(seen.age) > 0.0 { self.since(seen.age).to_session(&seen.place) } else { seen.place }
    }

    /// Slopes of a sighting's place by the pose and by the slip, `by_pose` being those by the pose.
    pub fn slopes(&self, seen: &Sighting, by_pose: &Matrix3x6<f64>) -> SMatrix<f64, 3, UNKNOWNS> {
        let mut slopes = SMatrix::<f64, 3, UNKNOWNS>::zeros();
        slopes.fixed_view_mut::<3, 6>(0, 0).copy_from(by_pose);
        slopes.fixed_view_mut::<3, 6>(0, 6).copy_from(&(by_pose * -self.part(seen.age)));
        slopes
    }

    /// Covariance of pose and slip at the start, `told` being that of the pose if the last motion were right.
    pub fn doubt(&self, told: &Matrix6<f64>) -> Joint {
        let part = self.part(1);
        let mut doubt = Joint::zeros();
        doubt.fixed_view_mut::<6, 6>(0, 0).copy_from(&(told + self.covariance * (part * part)));
        doubt.fixed_view_mut::<6, 6>(0, 6).copy_from(&(self.covariance * part));
        doubt.fixed_view_mut::<6, 6>(6, 0).copy_from(&(self.covariance * part));
        doubt.fixed_view_mut::<6, 6>(6, 6).copy_from(&self.covariance);
        doubt
    }

    /// What is expected of the slip: its information, and the pull back to none.
    pub fn expected(&self) -> (Matrix6<f64>, Vector6<f64>) {
        let information = self.expected.try_inverse().unwrap_or_else(Matrix6::zeros);
        (information, -(information * self.total))
    }

    fn part(&self, age: usize) -> f64 {
        if self.since == 0 { 0.0 } else { age.min(self.since) as f64 / self.since as f64 }
    }
}

/// What the sightings say for a pose and its slip, nats.
pub(super) fn evidence(aligned: &Aligned) -> f64 {
    let (expected, back) = aligned.slip.expected();
    let Some(factor) = aligned.information.cholesky() else { return f64::NEG_INFINITY };
    let volume: f64 = factor.l_dirty().diagonal().iter().map(|side| side.ln()).sum();
    let before = 0.5 * expected.determinant().ln();
    aligned.log_odds + 0.5 * aligned.slip.total.dot(&back) - volume + before
}

/// How much less the newest frame says, nats, for its motion being one of many that were expected and fitted to it: by
/// Laplace's rule - D^T B^-1 D / 2 + ln(det C / det B) / 2, C being the covariance that is left of D.
pub(super) fn lost_by_fit(aligned: &Aligned) -> f64 {
    let (expected, back) = aligned.slip.expected();
    let Some(factor) = aligned.information.cholesky() else { return f64::NEG_INFINITY };
    let known = factor.inverse().fixed_view::<6, 6>(6, 6).into_owned();
    0.5 * (aligned.slip.total.dot(&back) + (known * expected).determinant().ln())
}

fn unnoticed() -> Matrix6<f64> {
    let (place, turn) = UNNOTICED;
    Matrix6::from_diagonal(&Vector6::new(place, place, place, turn, turn, turn).map(|sigma| sigma * sigma))
}
