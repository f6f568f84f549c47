//! A vertical that is known in both clouds: what it leaves of a pose.

use super::placement::Placement;
use nalgebra::{Rotation3, Unit, Vector3};

/// How far the vertical of the true pose may lean from the one given: 10 degrees, two standard deviations.
const MAX_LEAN_RAD: f64 = 0.175;
const LEAN_RAD: f64 = MAX_LEAN_RAD / 2.0;

/// A proposed pose may lean by this many standard deviations of its own noise and the vertical's.
const GATE: f64 = 2.5;

/// Up in the query and in the map, unit vectors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Vertical {
    query: Vector3<f64>,
    map: Vector3<f64>,
}

impl Vertical {
    pub(crate) fn new([query, map]: [Vector3<f64>; 2]) -> Self {
        Self { query: query.normalize(), map: map.normalize() }
    }

    /// Share of all turns that keep the vertical: the cap of directions within the lean, over the sphere.
    pub(crate) fn share_of_turns() -> f64 {
        (1.0 - MAX_LEAN_RAD.cos()) / 2.0
    }

    pub(crate) fn admits(&self, pose: &Placement) -> bool {
        self.lean(pose) < MAX_LEAN_RAD
    }

    fn lean(&self, pose: &Placement) -> f64 {
        (pose.rotation * self.query).dot(&self.map).clamp(-1.0, 1.0).acos()
    }

    /// A pose whose turn about each axis has the `variance` (rad^2), pulled upright about `middle` as far as the
    /// vertical is surer than the pose; `None` where the two contradict each other.
    pub(crate) fn straightened(&self, pose: &Placement, middle: &Vector3<f64>, variance: f64) -> Option<Placement> {
        let (lean, both) = (self.lean(pose), variance + LEAN_RAD * LEAN_RAD);
        if lean > GATE * both.sqrt() {
            return None;
        }
        let Some(axis) = Unit::try_new((pose.rotation * self.query).cross(&self.map), f64::EPSILON) else {
            return Some(*pose);
        };
        Some(pose.turned(middle, &Rotation3::from_axis_angle(&axis, lean * variance / both)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sure_pose_stays_and_an_unsure_one_is_pulled_upright() {
        let up = Vertical::new([Vector3::z(), Vector3::z() * 2.0]);
        let middle = Vector3::new(0.4, -0.2, 1.0);
        let leaning = Placement::identity().turned(&middle, &Rotation3::new(Vector3::x() * 0.15));
        let kept = up.straightened(&leaning, &middle, 1e-6).expect("within reach");
        assert!((up.lean(&kept) - 0.15).abs() < 1e-3);
        let pulled = up.straightened(&leaning, &middle, 0.1).expect("within reach");
        assert!(up.lean(&pulled) < 0.02);
        assert!((pulled.apply(&middle) - leaning.apply(&middle)).norm() < 1e-12);
        let fallen = Placement::identity().turned(&middle, &Rotation3::new(Vector3::x() * 1.0));
        assert!(up.straightened(&fallen, &middle, 0.01).is_none());
        assert!(up.admits(&leaning) && !up.admits(&fallen));
    }

    #[test]
    fn a_pose_that_does_not_lean_is_kept_exactly() {
        let up = Vertical::new([Vector3::z(); 2]);
        let middle = Vector3::new(0.4, -0.2, 1.0);
        let pose = Placement::identity().turned(&middle, &Rotation3::new(Vector3::z() * 0.7));
        assert_eq!(up.straightened(&pose, &middle, 0.1), Some(pose));
    }

    #[test]
    fn the_share_of_turns_is_a_cap_of_ten_degrees() {
        assert!((Vertical::share_of_turns() - 0.0076).abs() < 1e-4);
    }
}
