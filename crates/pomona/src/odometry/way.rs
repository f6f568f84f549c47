//! What stays of a part: its keyframes, and the frames that hang on them.

use crate::pose::Pose;
use nalgebra::Matrix6;

/// A frame with its pose in a keyframe.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    pub(super) frame: usize,
    pub(super) keyframe: usize,
    pub(super) keyframe_from_camera: Pose,
    /// Of a step (translation, rotation) of the camera; none for the keyframe itself.
    pub(super) information: Option<Matrix6<f64>>,
    pub(super) inliers: usize,
}

/// Poses of a part, refined as long as they were in the window.
#[derive(Debug, Clone, Default)]
pub(super) struct Way {
    /// `session_from_camera` of the keyframes.
    pub(super) keyframes: Vec<Pose>,
    /// Of each keyframe but the first relative to the one before: inverse covariance of the step (translation, rotation)
    /// in the later camera's own frame.
    pub(super) information: Vec<Matrix6<f64>>,
    /// Median disparity of each keyframe.
    pub(super) disparities_px: Vec<f64>,
    /// All placed frames, in order.
    pub(super) placed: Vec<Placed>,
}

/// A measured motion between two frames, by their numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured {
    pub(super) first: usize,
    pub(super) second: usize,
    pub(super) first_from_second: Pose,
    pub(super) information: Matrix6<f64>,
}

impl Way {
    pub(super) fn pose(&self, placed: &Placed) -> Pose {
        self.keyframes[placed.keyframe].after(&placed.keyframe_from_camera)
    }

    /// Keyframes hang on the keyframe before, the frames between on the last keyframe before them.
    pub(super) fn motions(&self) -> Vec<Measured> {
        let mut keyframes = Vec::with_capacity(self.keyframes.len());
        let mut motions = Vec::with_capacity(self.placed.len());
        for placed in &self.placed {
            let second = placed.frame;
            if let Some(information) = placed.information {
                let first = keyframes[placed.keyframe];
                motions.push(Measured { first, second, first_from_second: placed.keyframe_from_camera, information });
                continue;
            }
            if let Some(&first) = keyframes.last() {
                let before = placed.keyframe - 1;
                let first_from_second = self.keyframes[placed.keyframe].seen_from(&self.keyframes[before]);
                motions.push(Measured { first, second, first_from_second, information: self.information[before] });
            }
            keyframes.push(second);
        }
        motions
    }
}
