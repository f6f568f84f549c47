//! What is known of the camera from the frames before.

use crate::bundle::steps::{carried, moved};
use crate::pose::Pose;
use nalgebra::{Matrix6, Vector6};

/// How a pose steps from frame to frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    /// `previous_from_camera`.
    pub previous_from_camera: Pose,
    /// Of its step in the frame of the camera after it.
    pub covariance: Matrix6<f64>,
}

/// Of a motion that was measured: half a centimetre and two hundredths of the way.
const MEASURED: (f64, f64, f64) = (0.005, 0.02, 0.005);

/// Of a motion that is thought to be the one before: half of the way, or as fast as a hand begins to move.
const REPEATED: (f64, f64, f64) = (0.03, 0.5, 0.035);

/// Of a motion of which nothing is known: what a vehicle does between two frames.
const UNKNOWN: (f64, f64, f64) = (0.15, 0.0, 0.1);

impl Motion {
    /// `covariance` is what was told of it.
    pub fn measured(previous_from_camera: Pose, covariance: Option<&Matrix6<f64>>) -> Self {
        let usual = Self::new(previous_from_camera, MEASURED);
        Self { covariance: covariance.copied().unwrap_or(usual.covariance), ..usual }
    }

    /// A motion that fruits correct at once.
    pub fn sure(previous_from_camera: Pose) -> Self {
        Self { previous_from_camera, covariance: Matrix6::zeros() }
    }

    pub fn repeated(previous_from_camera: Option<Pose>) -> Self {
        previous_from_camera.map_or_else(|| Self::new(Pose::IDENTITY, UNKNOWN), |step| Self::new(step, REPEATED))
    }

    fn new(previous_from_camera: Pose, (still_m, of_way, turn_rad): (f64, f64, f64)) -> Self {
        let way_m = previous_from_camera.translation.norm();
        let place = still_m + of_way * way_m;
        let sigmas = Vector6::new(place, place, place, turn_rad, turn_rad, turn_rad);
        Self { previous_from_camera, covariance: Matrix6::from_diagonal(&sigmas.map(|sigma| sigma * sigma)) }
    }
}

/// A pose with its covariance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Belief {
    /// `map_from_camera`.
    pub pose: Pose,
    /// Of its step in the camera's frame.
    pub covariance: Matrix6<f64>,
    /// The last motion, where one is known.
    pub motion: Option<Pose>,
}

impl Belief {
    /// The pose after a motion.
    pub fn after(&self, motion: &Motion) -> Self {
        let step = &motion.previous_from_camera;
        let turned = carried(step);
        Self {
            pose: self.pose.after(step),
            covariance: turned * self.covariance * turned.transpose() + motion.covariance,
            motion: Some(*step),
        }
    }

    /// Both together, though nobody knows what their errors share: covariance intersection (Julier and Uhlmann, 1997).
    pub fn joined(&self, other: &Self) -> Self {
        let Some((mine, its)) = self.covariance.try_inverse().zip(other.covariance.try_inverse()) else { return *self };
        let size = |share: f64| (mine * share + its * (1.0 - share)).try_inverse();
        let best = (0..=STEPS).map(|n| f64::from(n) / f64::from(STEPS)).filter_map(|share| Some((share, size(share)?)));
        let Some((share, covariance)) = best.min_by(|a, b| extent(&a.1).total_cmp(&extent(&b.1))) else { return *self };
        let apart = crate::bundle::steps::logarithm(&other.pose.seen_from(&self.pose));
        Self { pose: moved(&self.pose, &(covariance * its * apart * (1.0 - share))), covariance, motion: self.motion }
    }

    /// Standard deviation of the place along its worst axis, metres.
    pub fn sigma_m(&self) -> f64 {
        worst(&self.covariance, 0)
    }

    /// Standard deviation of the turn about its worst axis, radians.
    pub fn sigma_rad(&self) -> f64 {
        worst(&self.covariance, 3)
    }
}

/// Shares of two beliefs that are tried.
const STEPS: u8 = 10;

/// Distance at which a turn counts like a step, metres: that of the fruits.
const LEVER_M: f64 = 2.0;

fn worst(covariance: &Matrix6<f64>, from: usize) -> f64 {
    covariance.fixed_view::<3, 3>(from, from).symmetric_eigenvalues().max().max(0.0).sqrt()
}

fn extent(covariance: &Matrix6<f64>) -> f64 {
    let trace = |from: usize| (from..from + 3).map(|axis| covariance[(axis, axis)]).sum::<f64>();
    trace(0) + LEVER_M * LEVER_M * trace(3)
}
