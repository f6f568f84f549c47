//! A vertical that is known in both clouds: what it leaves of a pose.

use super::seeds::WITHIN;
use crate::geometry::Similarity;
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

/// How far the vertical of the true pose leans from the one given, radians: 4 degrees, one standard deviation. 10 are admitted.
const LEAN_RAD: f64 = 0.07;

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

    /// Up in the query.
    pub(super) fn of_query(&self) -> Vector3<f64> {
        self.query
    }

    /// The same where the query is upside down.
    pub(crate) fn inverted(&self) -> Self {
        Self { query: -self.query, map: self.map }
    }

    /// Share of all turns that keep the vertical: the cap of directions within the lean, over the sphere.
    pub(crate) fn share_of_turns() -> f64 {
        cap(gate(0.0))
    }

    /// How a pose stands whose turn about each axis has the `variance` (rad^2).
    pub(crate) fn stand(&self, pose: &Similarity, variance: f64) -> Stands {
        let within = gate(variance).min(std::f64::consts::FRAC_PI_2);
        let inverted = f64::from(u8::from(std::f64::consts::PI - self.lean(pose) < within));
        Stands { all: 1.0, inverted, by_chance: cap(within) }
    }

    pub(crate) fn admits(&self, pose: &Similarity) -> bool {
        self.lean(pose) < gate(0.0)
    }

    fn lean(&self, pose: &Similarity) -> f64 {
        (pose.rotation * self.query).dot(&self.map).clamp(-1.0, 1.0).acos()
    }

    /// A pose whose turn about each axis has the `variance` (rad^2), pulled upright about `middle` as far as the
    /// vertical is surer than the pose; `None` where the two contradict each other.
    pub(crate) fn straightened(&self, pose: &Similarity, middle: &Vector3<f64>, variance: f64) -> Option<Similarity> {
        let precision = Matrix3::identity() / variance.max(f64::MIN_POSITIVE);
        (self.lean(pose) <= gate(variance)).then(|| self.upheld(pose, middle, &precision))
    }

    /// The pose that pairs, which fix its turn with the `precision` (rad^-2), and the vertical say together.
    ///
    /// A cordon fixes its own roll badly and all else well: it is the roll that is pulled upright.
    pub(crate) fn upheld(&self, pose: &Similarity, middle: &Vector3<f64>, precision: &Matrix3<f64>) -> Similarity {
        let Some(axis) = Unit::try_new((pose.rotation * self.query).cross(&self.map), f64::EPSILON) else {
            return *pose;
        };
        let level = (Matrix3::identity() - self.map * self.map.transpose()) / (LEAN_RAD * LEAN_RAD);
        let turn = (precision + level).cholesky().map(|both| both.solve(&(level * axis.scale(self.lean(pose)))));
        turn.map_or(*pose, |turn| pose.turned(middle, &Rotation3::new(turn)))
    }
}

/// How far a pose may lean whose turn about each axis has the `variance`, radians.
fn gate(variance: f64) -> f64 {
    WITHIN * (variance + LEAN_RAD * LEAN_RAD).sqrt()
}

/// Share of all directions within an angle of one.
fn cap(angle: f64) -> f64 {
    (1.0 - angle.cos()) / 2.0
}

/// How poses stand that seeds propose.
///
/// Wrong poses are turned alike in all directions only where fruits hang so. Wires and tiers of branches lie on themselves
/// upright, and as often upside down. A pose that is upside down is wrong for sure, so these are counted.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Stands {
    all: f64,
    /// Upside down, as nearly as a pose is taken for upright.
    inverted: f64,
    /// As many as would be, were all turns alike.
    by_chance: f64,
}

impl std::ops::Add for Stands {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            all: self.all + other.all,
            inverted: self.inverted + other.inverted,
            by_chance: self.by_chance + other.by_chance,
        }
    }
}

impl Stands {
    /// Share of the wrong poses that a known vertical leaves: that of all turns, and those that lie on themselves.
    ///
    /// As many more as have one upright by chance are taken for turned alike, so that few poses say little.
    pub(crate) fn share_left(&self) -> f64 {
        let alike = Vertical::share_of_turns();
        alike + (self.inverted - self.by_chance).max(0.0) / (self.all + 1.0 / alike)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verified::fixture::Dice;
    use nalgebra::{Quaternion, UnitQuaternion};

    #[test]
    fn a_sure_pose_stays_and_an_unsure_one_is_pulled_upright() {
        let up = Vertical::new([Vector3::z(), Vector3::z() * 2.0]);
        let middle = Vector3::new(0.4, -0.2, 1.0);
        let leaning = Similarity::identity().turned(&middle, &Rotation3::new(Vector3::x() * 0.15));
        let kept = up.straightened(&leaning, &middle, 1e-6).expect("within reach");
        assert!((up.lean(&kept) - 0.15).abs() < 1e-3);
        let pulled = up.straightened(&leaning, &middle, 0.1).expect("within reach");
        assert!(up.lean(&pulled) < 0.02);
        assert!((pulled.image(&middle) - leaning.image(&middle)).norm() < 1e-12);
        let fallen = Similarity::identity().turned(&middle, &Rotation3::new(Vector3::x() * 1.0));
        assert!(up.straightened(&fallen, &middle, 0.01).is_none());
        assert!(up.admits(&leaning) && !up.admits(&fallen));
    }

    #[test]
    fn pairs_along_a_line_keep_its_direction_and_give_up_its_roll() {
        let up = Vertical::new([Vector3::z(); 2]);
        let leaning = Similarity::identity().turned(&Vector3::zeros(), &Rotation3::new(Vector3::new(0.1, 0.1, 0.1)));
        let precision = leaning.image_of_covariance(&Matrix3::from_diagonal(&Vector3::new(1.0, 1e8, 1e8)));
        let held = up.upheld(&leaning, &Vector3::zeros(), &precision);
        let along = |pose: &Similarity| pose.rotation * Vector3::x();
        assert!((along(&held) - along(&leaning)).norm() < 0.01);
        assert!(up.lean(&held) < 0.12 && (up.lean(&leaning) - 0.141).abs() < 0.01);
        assert!((held.rotation * Vector3::y()).z.abs() < 0.02 && (leaning.rotation * Vector3::y()).z > 0.09);
    }

    #[test]
    fn a_pose_that_does_not_lean_is_kept_exactly() {
        let up = Vertical::new([Vector3::z(); 2]);
        let middle = Vector3::new(0.4, -0.2, 1.0);
        let pose = Similarity::identity().turned(&middle, &Rotation3::new(Vector3::z() * 0.7));
        assert_eq!(up.straightened(&pose, &middle, 0.1), Some(pose));
    }

    /// Poses that `turn_of` gives, counted.
    fn counted(turn_of: impl Fn(&mut Dice) -> Rotation3<f64>) -> Stands {
        let (up, mut dice) = (Vertical::new([Vector3::z(); 2]), Dice(5));
        let stand = |_| {
            let pose = Similarity { rotation: turn_of(&mut dice), ..Similarity::identity() };
            up.stand(&pose, 0.01)
        };
        (0..2000).map(stand).fold(Stands::default(), std::ops::Add::add)
    }

    #[test]
    fn what_lies_on_itself_upside_down_counts_and_what_is_turned_alike_does_not() {
        let turned = |dice: &mut Dice| {
            let [x, y, z, w] = [0; 4].map(|_| dice.normal().x);
            Rotation3::from(UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)))
        };
        let alike = Vertical::share_of_turns();
        assert!((alike..2.0 * alike).contains(&counted(turned).share_left()));
        assert!((Stands::default().share_left() - alike).abs() < 1e-12);
        // One in ten is upside down, by some degrees more or less.
        let wires = |dice: &mut Dice| {
            if dice.uniform() < 0.1 {
                Rotation3::new(dice.normal() * 0.1) * Rotation3::new(Vector3::x() * std::f64::consts::PI)
            } else {
                turned(dice)
            }
        };
        assert!((0.07..0.13).contains(&counted(wires).share_left()));
    }

    #[test]
    fn the_share_of_turns_is_a_cap_of_ten_degrees() {
        assert!((Vertical::share_of_turns() - 0.0076).abs() < 1e-4);
    }
}
