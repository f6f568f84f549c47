//! One part of a drive: frames that hang together, followed from keyframe to keyframe.

use super::Lens;
use super::config::OdometryConfig;
use super::eyes::Eyes;
use super::reference::{Found, Reference};
use super::way::{Placed, Way};
use super::window::{Sighting, Window};
use crate::pose::Pose;
use crate::statistics::median;
use nalgebra::{Rotation3, Vector2, Vector3};

/// Frames that hang together; the first one's camera is the frame of reference.
#[derive(Debug, Clone)]
pub(super) struct Part {
    pub(super) way: Way,
    window: Window,
    reference: Reference,
    last_frame: usize,
    last_pose: Pose,
    /// The motion of one frame, in the camera's own frame.
    velocity: Option<Pose>,
    per_cell: usize,
}

impl Part {
    /// Begins with a frame, or says why it is none to begin with.
    pub(super) fn begin<E: Eyes>(
        eyes: &mut E,
        frame: usize,
        with: (&Lens, &OdometryConfig),
    ) -> Result<Result<Self, String>, E::Error> {
        let (window, here) = (Window::default(), Pose::IDENTITY);
        let reference = Reference::of(&window, here);
        let per_cell = with.1.most_per_cell;
        let (way, last_frame) = (Way::default(), frame);
        let mut part = Self { way, window, reference, last_frame, last_pose: here, velocity: None, per_cell };
        part.add_keyframe(eyes, frame, here, &[], with)?;
        let (offered, expected) = (part.reference.numbers.len(), with.1.min_inliers);
        if offered < expected {
            return Ok(Err(format!("found {offered} points with depth, expected at least {expected}")));
        }
        Ok(Ok(part))
    }

    /// Places a frame: whether it became a keyframe, or why it cannot be placed.
    ///
    /// The pose is looked for from where the motion so far leads to, then at rest, then where patches are found again.
    pub(super) fn place<E: Eyes>(
        &mut self,
        eyes: &mut E,
        frame: usize,
        with: (&Lens, &OdometryConfig),
    ) -> Result<Result<bool, String>, E::Error> {
        let at_rest = self.velocity.map(|_| self.last_pose);
        let mut reason = None;
        for expected in [Some(self.predicted(frame)), at_rest].into_iter().flatten() {
            match self.tried(eyes, frame, &expected, with)? {
                Ok(found) => return Ok(Ok(self.accept(eyes, frame, &found, with)?)),
                Err(objection) => reason.get_or_insert(objection),
            };
        }
        if let Some(expected) = self.reference.found_again(eyes, &self.last_pose, with)? {
            match self.tried(eyes, frame, &expected, with)? {
                Ok(found) => return Ok(Ok(self.accept(eyes, frame, &found, with)?)),
                Err(objection) => reason.get_or_insert(objection),
            };
        }
        Ok(Err(reason.unwrap_or_default()))
    }

    /// A pose that is to be believed, found from where one is expected, or why there is none.
    fn tried<E: Eyes>(
        &self,
        eyes: &mut E,
        frame: usize,
        expected: &Pose,
        with: (&Lens, &OdometryConfig),
    ) -> Result<Result<Found, String>, E::Error> {
        let found = self.reference.locate(eyes, expected, with)?;
        Ok(found.ok_or_else(|| "found no points to follow".to_owned()).and_then(|found| {
            match self.objection(frame, &found, with.1) {
                Some(objection) => Err(objection),
                None => Ok(found),
            }
        }))
    }

    /// Where the motion so far leads to.
    fn predicted(&self, frame: usize) -> Pose {
        let Some(velocity) = self.velocity else { return self.last_pose };
        let way = (self.last_frame..frame).fold(Pose::IDENTITY, |way, _| way.after(&velocity));
        self.last_pose.after(&way)
    }

    /// Why a pose is not to be believed.
    fn objection(&self, frame: usize, found: &Found, config: &OdometryConfig) -> Option<String> {
        let away = found.pose.seen_from(&self.predicted(frame));
        let (shift_m, turn_rad) = (away.translation.norm(), away.turn().norm());
        let smooth = self.velocity.is_some() && shift_m < config.smooth_m && turn_rad < config.smooth_rad;
        let (least, share) =
            if smooth { (config.min_inliers, config.min_share) } else { (config.sure_inliers, config.sure_share) };
        let (agree, followed) = (found.agreeing.len(), found.followed);
        let needed = least.max((share * followed as f64) as usize);
        let jump = || format!(", {shift_m:.2} m and {:.0} degrees from where the motion leads", turn_rad.to_degrees());
        (agree < needed).then(|| {
            let jump = if smooth { String::new() } else { jump() };
            format!("found {agree} of {followed} points that agree{jump}, expected at least {needed}")
        })
    }

    fn accept<E: Eyes>(
        &mut self,
        eyes: &mut E,
        frame: usize,
        found: &Found,
        with: (&Lens, &OdometryConfig),
    ) -> Result<bool, E::Error> {
        self.velocity = Some(root(&found.pose.seen_from(&self.last_pose), frame - self.last_frame));
        (self.last_frame, self.last_pose) = (frame, found.pose);
        if self.is_keyframe(found, with.1) {
            let config = with.1;
            let wanted = (self.per_cell * config.wanted_inliers).div_ceil(found.agreeing.len());
            self.per_cell = wanted.clamp(config.least_per_cell, config.most_per_cell);
            let carried = self.reference.carried_on(found, with.0);
            self.last_pose = self.add_keyframe(eyes, frame, found.pose, &carried, with)?;
            return Ok(true);
        }
        self.way.placed.push(Placed {
            frame,
            keyframe: self.way.keyframes.len() - 1,
            keyframe_from_camera: found.pose.seen_from(&self.reference.pose),
            information: Some(found.information),
            inliers: found.agreeing.len(),
        });
        Ok(false)
    }

    fn is_keyframe(&self, found: &Found, config: &OdometryConfig) -> bool {
        let moved = found.pose.seen_from(&self.reference.pose);
        let depth_m = |&(row, _): &(usize, _)| found.pose.to_camera(&self.reference.positions[row].coords).z;
        let median_depth_m = median(&mut found.agreeing.iter().map(depth_m).collect::<Vec<_>>());
        (found.agreeing.len() as f64) < config.keyframe_share * self.reference.numbers.len() as f64
            || moved.translation.norm() > config.keyframe_shift * median_depth_m
            || moved.turn().norm() > config.keyframe_rad
    }

    /// Makes a frame the reference: points that agree go on, new corners fill the gaps. Gives its pose, adjusted.
    fn add_keyframe<E: Eyes>(
        &mut self,
        eyes: &mut E,
        frame: usize,
        pose: Pose,
        carried: &[(Sighting, f64)],
        (lens, config): (&Lens, &OdometryConfig),
    ) -> Result<Pose, E::Error> {
        let places_px: Vec<Vector2<f64>> = carried.iter().map(|(one, _)| one.seen.xy()).collect();
        let expected_px: Vec<f64> = carried.iter().map(|&(_, disparity_px)| disparity_px).collect();
        let seen = eyes.measure(&places_px, &expected_px, self.per_cell)?;
        let known = carried.iter().zip(&seen).map(|(&(one, _), &seen)| Sighting { seen, ..one }).collect();
        let new = seen.iter().skip(carried.len()).filter(|seen| seen.z.is_finite());
        let fresh: Vec<Vector3<f64>> = new.copied().collect();
        self.window.add(&mut self.way, pose, known, &fresh, (&lens.camera, config))?;
        let (keyframe, inliers) = (self.way.keyframes.len() - 1, carried.len());
        let itself = Pose::IDENTITY;
        self.way.placed.push(Placed { frame, keyframe, keyframe_from_camera: itself, information: None, inliers });
        let adjusted = self.way.keyframes[keyframe];
        self.reference = Reference::of(&self.window, adjusted);
        Ok(adjusted)
    }
}

/// One of `steps` equal parts of a motion; the translation's turn on the way is neglected.
fn root(motion: &Pose, steps: usize) -> Pose {
    if steps == 1 {
        return *motion;
    }
    let part = 1.0 / steps as f64;
    Pose { rotation: Rotation3::new(motion.turn() * part), translation: motion.translation * part }
}
