//! Where the camera went, from stereo or depth pictures alone.
//!
//! Points are followed from the newest keyframe to each picture, a pose is taken on which they agree, and keyframes are
//! adjusted together in a window. A frame that cannot be placed has no pose; when the next one cannot be placed
//! either, a new part begins there, in a frame of reference of its own: a break is told and never bridged by a guess.
//!
//! No pictures here: what they show is asked through [`Eyes`], some times a frame. Equations and figures:
//! `docs/odometry.md`.

mod config;
mod corners;
mod eyes;
mod following;
mod looking;
mod part;
mod reference;
mod rejoining;
mod way;
mod window;

use crate::camera::Camera;
use crate::pose::Pose;
use crate::statistics::median;
use nalgebra::{Matrix6, Vector2, Vector3};

pub use config::{OdometryConfig, PicturesConfig};
pub use eyes::{Eyes, FoundAgain};
pub use following::follow;
pub use looking::{corners, disparities};
pub use rejoining::{Passage, Places, rejoined};

use part::Part;
use way::Way;

/// A rectified stereo camera as [`Eyes`] see it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// The camera; where only depth is measured, with the baseline of the settings.
    pub camera: Camera,
}

/// Centre of the first pixel where coordinates begin at its corner; those of [`Eyes`] begin at its centre.
const CENTRE_PX: f64 = 0.5;

impl Lens {
    /// The lens of a camera; without a baseline that of depth cameras.
    pub fn new(camera: &Camera, config: &OdometryConfig) -> Self {
        let baseline_m = Some(camera.baseline_m.unwrap_or(config.depth_baseline_m));
        Self { camera: Camera { cx: camera.cx - CENTRE_PX, cy: camera.cy - CENTRE_PX, baseline_m, ..*camera } }
    }

    /// Disparity of what is a metre away.
    pub fn reach_px_m(&self) -> f64 {
        self.camera.focal_baseline_px_m()
    }

    /// Largest disparity that is searched for.
    pub fn farthest_px(&self, config: &OdometryConfig) -> f64 {
        (self.reach_px_m() / config.searched_m).min(self.camera.width as f64 / 2.0)
    }

    /// Where a point in the camera's frame is seen; none nearer than `nearest_m`, or outside the picture.
    fn seen(&self, point: &Vector3<f64>, nearest_m: f64) -> Option<Vector2<f64>> {
        let (place, size_px) = (self.camera.project(point).xy(), self.camera.size_px());
        let inside = (0..2).all(|axis| place[axis] > 0.0 && place[axis] < size_px[axis]);
        (point.z > nearest_m && inside).then_some(place)
    }
}

/// What odometry says of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// `session_from_camera` in the frame of reference of its part, the camera of the part's first frame; none where the
    /// frame could not be placed.
    pub pose: Option<Pose>,
    /// Number of the part, from 0. Nothing is known of the pose of one part in another.
    pub part: usize,
    /// On the first frame of every part but the first: why the part before ended.
    pub broken: Option<String>,
    /// Why this frame has no pose.
    pub lost: Option<String>,
    /// Points that agree with the pose.
    pub inliers: usize,
    /// Whether the frame became one of those that are adjusted together.
    pub keyframe: bool,
}

/// Refined poses so far, and the motions between them; a struct of arrays.
#[derive(Debug, Clone, Default)]
pub struct OdometryTrajectory {
    /// Placed frames, counted from 0 in the order in which they were given.
    pub frames: Vec<usize>,
    /// Part of each.
    pub parts: Vec<usize>,
    /// `session_from_camera` of each, in the frame of reference of its part.
    pub poses: Vec<Pose>,
    /// Rows of `frames` between which a motion was measured, both of one part; the second ascends.
    pub pairs: Vec<(usize, usize)>,
    /// The measured motions.
    pub first_from_second: Vec<Pose>,
    /// Inverse covariances of a step (translation, rotation) of the second camera in its own frame.
    pub information: Vec<Matrix6<f64>>,
    /// Median over the keyframes, NaN where there is none.
    pub median_disparity_px: f64,
}

/// Motion of a camera, frame by frame.
#[derive(Debug, Clone)]
pub struct Odometry {
    lens: Lens,
    config: OdometryConfig,
    ended: Vec<Way>,
    open: Option<Part>,
    count: usize,
    /// Why the frames since the last placed one have no pose.
    failed: Option<String>,
}

impl Odometry {
    /// An odometry that has seen nothing.
    pub fn new(lens: Lens, config: OdometryConfig) -> Self {
        Self { lens, config, ended: Vec::new(), open: None, count: 0, failed: None }
    }

    /// Its settings.
    pub fn config(&self) -> &OdometryConfig {
        &self.config
    }

    /// Its camera.
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// Takes the next frame.
    ///
    /// # Errors
    /// What the pictures say, and numbers from them that are not finite.
    pub fn take<E: Eyes>(&mut self, eyes: &mut E) -> Result<Motion, E::Error> {
        let frame = self.next_frame();
        let with = (&self.lens, &self.config);
        if let Some(part) = &mut self.open {
            match part.place(eyes, frame, with)? {
                Ok(keyframe) => {
                    self.failed = None;
                    return Ok(self.placed(keyframe, None));
                }
                Err(reason) => match &mut self.failed {
                    None => return Ok(self.lose(reason)),
                    Some(failed) => *failed = format!("{failed}; then {reason}"),
                },
            }
        }
        match Part::begin(eyes, frame, with)? {
            Err(reason) => Ok(self.lose(reason)),
            Ok(begun) => {
                let failed = self.failed.take();
                let ended = self.open.replace(begun);
                let broken = ended.is_some().then_some(failed).flatten();
                self.ended.extend(ended.map(|part| part.way));
                Ok(self.placed(true, broken))
            }
        }
    }

    /// Takes a frame whose picture cannot be used.
    pub fn skip(&mut self, reason: String) -> Motion {
        self.next_frame();
        self.lose(reason)
    }

    fn next_frame(&mut self) -> usize {
        self.count += 1;
        self.count - 1
    }

    fn lose(&mut self, reason: String) -> Motion {
        self.failed.get_or_insert_with(|| reason.clone());
        let part = self.ended.len();
        Motion { pose: None, part, broken: None, lost: Some(reason), inliers: 0, keyframe: false }
    }

    fn placed(&self, keyframe: bool, broken: Option<String>) -> Motion {
        let way = self.open.as_ref().map(|part| &part.way);
        let newest = way.and_then(|way| way.placed.last().map(|placed| (way.pose(placed), placed.inliers)));
        let (pose, inliers) = newest.unzip();
        Motion { pose, part: self.ended.len(), broken, lost: None, inliers: inliers.unwrap_or(0), keyframe }
    }

    /// The refined poses so far and the motions between them.
    ///
    /// Keyframes hang on the keyframe before, with the information that the adjustment leaves when all points and other
    /// poses are free; the frames between hang on the last keyframe before them.
    pub fn trajectory(&self) -> OdometryTrajectory {
        let ways: Vec<&Way> = self.ended.iter().chain(self.open.as_ref().map(|part| &part.way)).collect();
        let mut all = OdometryTrajectory::default();
        let mut row_of = vec![usize::MAX; self.count];
        for (part, way) in ways.iter().enumerate() {
            for placed in &way.placed {
                row_of[placed.frame] = all.frames.len();
                all.frames.push(placed.frame);
                all.parts.push(part);
                all.poses.push(way.pose(placed));
            }
            for motion in way.motions() {
                all.pairs.push((row_of[motion.first], row_of[motion.second]));
                all.first_from_second.push(motion.first_from_second);
                all.information.push(motion.information);
            }
        }
        let mut disparities_px: Vec<f64> = ways.iter().flat_map(|way| &way.disparities_px).copied().collect();
        all.median_disparity_px = median(&mut disparities_px);
        all
    }
}

#[cfg(test)]
mod tests;
