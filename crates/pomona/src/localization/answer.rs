//! What localisation gives.

use crate::answer::Verdict;
use crate::error::{Error, Result};
use crate::pose::Pose;
use nalgebra::Matrix6;

/// A sighting and the map's fruit that it most probably shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapPair {
    /// Row in the frame.
    pub seen: usize,
    /// Row in the map.
    pub map: usize,
    /// Probability that the two are one fruit.
    pub probability: f64,
}

/// No camera goes farther between two frames, metres; squares of what is 1e160 times as far are no numbers.
const FAR_M: f64 = 1e6;

/// How the camera moved, as odometry tells it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToldMotion {
    /// The camera's pose now in its frame before.
    pub previous_from_camera: Pose,
    /// Covariance of its step, as [`Localization::covariance`]; `None`: what is usual of such a way.
    pub covariance: Option<Matrix6<f64>>,
}

impl From<Pose> for ToldMotion {
    fn from(previous_from_camera: Pose) -> Self {
        Self { previous_from_camera, covariance: None }
    }
}

impl ToldMotion {
    /// Checks the way and its covariance.
    ///
    /// # Errors
    /// The way is no rigid transform; it, or the standard deviation of one, is beyond all ways; the covariance is not symmetric positive definite.
    pub fn validate(&self) -> Result<()> {
        self.previous_from_camera.validate()?;
        let reason = "found one beyond 1,000 km, expected metres between two frames".to_owned();
        if self.previous_from_camera.translation.norm() > FAR_M {
            return Err(Error::Request { name: "moved", reason });
        }
        if self.covariance.is_some_and(|matrix| matrix.amax() > FAR_M * FAR_M) {
            return Err(Error::Request { name: "motion covariance", reason });
        }
        let is_one = |matrix: &Matrix6<f64>| *matrix == matrix.transpose() && matrix.cholesky().is_some();
        if self.covariance.as_ref().is_none_or(is_one) {
            return Ok(());
        }
        let reason = "found a matrix that is not symmetric positive definite".to_owned();
        Err(Error::Request { name: "motion covariance", reason })
    }
}

/// Where the camera is, or why nobody can say.
#[derive(Debug, Clone, PartialEq)]
pub struct Localization {
    /// `Found`: there is a pose. `TooFew`: too few fruits to say. `Ambiguous`: several poses are as good. `NoMatch`: the
    /// fruits are not those of the map.
    pub verdict: Verdict,
    /// `map_from_camera`; `None` unless found.
    pub pose: Option<Pose>,
    /// Covariance of the pose's step (x, y, z, then turns about x, y, z), metres and radians, in the camera's own frame;
    /// not numbers unless found.
    pub covariance: Matrix6<f64>,
    /// Fruits of this frame found again, sorted by row, one to one.
    pub pairs: Vec<MapPair>,
    /// Evidence of the fruits for the pose against chance, nats; NaN where no pose was looked at.
    pub log_odds: f64,
    /// Whether the pose follows from the one before; else it was found from nothing.
    pub tracked: bool,
}

impl Localization {
    pub(super) fn without_pose(verdict: Verdict) -> Self {
        Self {
            verdict,
            pose: None,
            covariance: Matrix6::from_element(f64::NAN),
            pairs: Vec::new(),
            log_odds: f64::NAN,
            tracked: false,
        }
    }

    /// The same without its pose, unless it is found.
    pub(super) fn checked(self) -> Self {
        if self.verdict == Verdict::Found { self } else { Self::without_pose(self.verdict) }
    }
}
