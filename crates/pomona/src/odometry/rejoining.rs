//! Where one part of a drive lies beside another one, by the fruits that both saw and the way that the camera went.
//!
//! The fruits at the end of one part and at the begin of the next are few, and their depths poor: most were seen once. So a
//! pose is judged by the covariances: with S the sum of those of two places, d apart, the pair gains
//!
//! ```text
//! ln N(d; 0, S) - ln rho,    rho the density of the fruits,
//! ```
//!
//! where that is positive, and the pose the largest sum over pairs, one to one. Poses are tried along the camera's last
//! direction, each settled by Gauss and Newton's steps on its pairs (Cauchy's loss).

use crate::assignment::assign;
use crate::pose::Pose;
use nalgebra::{Matrix3, Matrix6, Point3, Rotation3, SMatrix, Vector3, Vector6};

/// Distances along the camera's direction that are tried, metres: half of what a step settles, up to where an arm's length
/// from a row shows nothing twice.
const STEP_M: f64 = 0.05;
const WAYS: usize = 50;

/// How far the camera leaves the straight line meanwhile: a hand's breadth and 2 degrees.
const PRIOR_M: f64 = 0.1;
const PRIOR_RAD: f64 = 0.035;

/// What places differ by beyond their covariances, metres: fruits are no spheres, and are seen from elsewhere.
const PLACE_SIGMA_M: f64 = 0.01;

/// Farther apart, two places are not weighed: poor depths err by less.
const REACH_M: f64 = 0.4;

/// Steps of a pose.
const STEPS: usize = 6;

/// Cauchy's c^2: the mean of m^2 of a Gaussian place.
const SCALE2: f64 = 3.0;

/// Least gain: on the rendered row wrong poses gain up to 25, true ones 50 and more.
const SURE_NATS: f64 = 40.0;

/// Least number of pairs.
const SURE_PAIRS: usize = 8;

/// By how much any pose that is so far away, metres, must gain less.
const MARGIN_NATS: f64 = 15.0;
const ELSEWHERE_M: f64 = 0.2;

/// Places of fruits, metres, with covariances.
#[derive(Debug, Clone, Default)]
pub struct Places {
    /// Places.
    pub points: Vec<Point3<f64>>,
    /// One each.
    pub covariances: Vec<Matrix3<f64>>,
}

/// What the camera did at the end of the one part and at the begin of the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passage {
    /// Pose of the last camera of the part before.
    pub last: Pose,
    /// Last motion of the camera, in its own frame; only its direction counts.
    pub step: Vector3<f64>,
    /// Pose of the first camera of the part.
    pub first: Pose,
}

/// A pose `before_from_part`, what it gains, and its number of pairs.
struct Tried {
    pose: Pose,
    nats: f64,
    pairs: usize,
}

/// Pairs of rows, and what they gain together.
struct Paired {
    rows: Vec<(usize, usize)>,
    nats: f64,
}

/// `before_from_part`; none where the fruits do not tell it.
pub fn rejoined(before: &Places, part: &Places, passage: &Passage) -> Option<Pose> {
    let length_m = passage.step.norm();
    if length_m.is_nan() || length_m <= 0.0 || before.points.is_empty() || part.points.is_empty() {
        return None;
    }
    let tried: Vec<Tried> = (0..WAYS)
        .map(|way| {
            let ahead = Pose { translation: passage.step * (STEP_M * way as f64 / length_m), ..Pose::IDENTITY };
            settled(before, part, &passage.last.after(&ahead).after(&passage.first.inverse()))
        })
        .collect();
    let best = tried.iter().reduce(|best, one| if one.nats > best.nats { one } else { best })?;
    let camera = |one: &Tried| one.pose.after(&passage.first).translation;
    let elsewhere = tried.iter().filter(|one| (camera(one) - camera(best)).norm() > ELSEWHERE_M);
    let rival = elsewhere.map(|one| one.nats).fold(0.0, f64::max);
    let is_sure = best.nats > SURE_NATS.max(rival + MARGIN_NATS) && best.pairs >= SURE_PAIRS;
    is_sure.then_some(best.pose)
}

fn settled(before: &Places, part: &Places, start: &Pose) -> Tried {
    let mut pose = *start;
    for _ in 0..STEPS {
        let moved = part.moved(&pose);
        let paired = paired(before, &moved);
        let pairs = paired.rows.len();
        if pairs < 3 {
            return Tried { pose, nats: paired.nats, pairs };
        }
        let Some(next) = stepped(before, &moved, &paired.rows, &pose, start) else { break };
        pose = next;
    }
    let paired = paired(before, &part.moved(&pose));
    Tried { pose, nats: paired.nats, pairs: paired.rows.len() }
}

impl Places {
    fn moved(&self, pose: &Pose) -> Self {
        Self {
            points: self.points.iter().map(|point| pose.to_session(&point.coords).into()).collect(),
            covariances: self.covariances.iter().map(|one| pose.covariance_to_session(one)).collect(),
        }
    }

    /// Fruits a cubic metre of the box around them.
    fn density(&self) -> f64 {
        let extent = |axis: usize| {
            let along = self.points.iter().map(|point| point[axis]);
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
            (high - low).max(REACH_M)
        };
        self.points.len() as f64 / (extent(0) * extent(1) * extent(2))
    }
}

/// The way from one place to the other, and the sum of their covariances.
fn apart(before: &Places, part: &Places, (row, column): (usize, usize)) -> (Vector3<f64>, Matrix3<f64>) {
    let spread = before.covariances[row] + part.covariances[column];
    (before.points[row] - part.points[column], spread + Matrix3::identity() * PLACE_SIGMA_M.powi(2))
}

/// The pairs that gain most together.
fn paired(before: &Places, part: &Places) -> Paired {
    let log_density = before.density().ln();
    let mut edges = Vec::new();
    for row in 0..before.points.len() {
        for column in 0..part.points.len() {
            if (before.points[row] - part.points[column]).norm() < REACH_M {
                let gain = log_likelihood(apart(before, part, (row, column))) - log_density;
                edges.push((row, column, gain));
            }
        }
    }
    let partners = assign(before.points.len(), part.points.len(), &edges);
    let rows: Vec<_> = partners.iter().enumerate().filter_map(|(row, &column)| Some((row, column?))).collect();
    let log = |&pair: &(usize, usize)| log_likelihood(apart(before, part, pair)) - log_density;
    let nats = rows.iter().map(log).sum();
    Paired { rows, nats }
}

/// ln N(d; 0, S).
fn log_likelihood((apart, spread): (Vector3<f64>, Matrix3<f64>)) -> f64 {
    let Some(factor) = spread.cholesky() else { return f64::NEG_INFINITY };
    let log_determinant = 2.0 * factor.l().diagonal().map(f64::ln).sum() + 3.0 * std::f64::consts::TAU.ln();
    -0.5 * (apart.dot(&factor.solve(&apart)) + log_determinant)
}

/// The pose after one step (translation, rotation about the part's origin) towards the pairs.
fn stepped(before: &Places, moved: &Places, pairs: &[(usize, usize)], pose: &Pose, start: &Pose) -> Option<Pose> {
    let weights = [PRIOR_M.powi(-2), PRIOR_M.powi(-2), PRIOR_M.powi(-2)];
    let turns = [PRIOR_RAD.powi(-2), PRIOR_RAD.powi(-2), PRIOR_RAD.powi(-2)];
    let prior = Matrix6::from_diagonal(&Vector6::from_iterator(weights.into_iter().chain(turns)));
    let shift = pose.translation - start.translation;
    let turn = pose.after(&start.inverse()).turn();
    let mut matrix = prior;
    let mut right = -prior * Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
    for &pair in pairs {
        let (apart, spread) = apart(before, moved, pair);
        let information = spread.try_inverse()?;
        let weight = information / (1.0 + apart.dot(&(information * apart)) / SCALE2);
        let arm = moved.points[pair.1].coords - pose.translation;
        let mut slope = SMatrix::<f64, 3, 6>::identity();
        slope.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
        matrix += slope.transpose() * weight * slope;
        right += slope.transpose() * weight * apart;
    }
    let step = matrix.cholesky()?.solve(&right);
    let rotation = Rotation3::new(step.fixed_rows::<3>(3).into_owned()) * pose.rotation;
    Some(Pose { rotation, translation: pose.translation + step.fixed_rows::<3>(0) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix;

    /// Fruits of a row along x, at about 1.5 m, and where the second part has them.
    fn row(n: usize, part_from_before: &Pose) -> (Places, Places) {
        let mut random = SplitMix(11);
        let mut unit = || random.below(1 << 20) as f64 / f64::from(1 << 20) - 0.5;
        let covariances = vec![Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 4e-4)); n];
        let points: Vec<_> = (0..n).map(|_| Point3::new(2.0 * unit() + 1.0, unit(), 0.6 * unit() + 1.5)).collect();
        let seen = points
            .iter()
            .map(|point| point.coords + Vector3::new(0.01 * unit(), 0.01 * unit(), 0.02 * unit()))
            .map(|place| part_from_before.to_session(&place).into());
        let seen = Places { points: seen.collect(), covariances: covariances.clone() };
        (Places { points, covariances }, seen)
    }

    fn jump() -> (Pose, Passage) {
        let before_from_part =
            Pose { rotation: Rotation3::new(Vector3::y() * 0.01), translation: Vector3::new(1.1, 0.02, -0.03) };
        let passage = Passage { last: Pose::IDENTITY, step: Vector3::x() * 0.2, first: Pose::IDENTITY };
        (before_from_part, passage)
    }

    #[test]
    fn a_jump_of_a_metre_is_found() {
        let (true_pose, passage) = jump();
        let (before, part) = row(30, &true_pose.inverse());
        let found = rejoined(&before, &part, &passage).expect("thirty fruits tell");
        let off = found.seen_from(&true_pose);
        assert!(off.translation.norm() < 0.02 && off.rotation.angle() < 0.01, "{off:?}");
    }

    #[test]
    fn other_fruits_few_fruits_and_a_camera_at_rest_tell_nothing() {
        let (true_pose, passage) = jump();
        let (before, part) = row(30, &true_pose.inverse());
        let mirrored: Vec<_> = part.points.iter().map(|one| Point3::new(one.x, -one.y, 3.0 - one.z)).collect();
        let other = Places { points: mirrored, covariances: part.covariances.clone() };
        assert!(rejoined(&before, &other, &passage).is_none());
        let (few, fewer) = row(7, &true_pose.inverse());
        assert!(rejoined(&few, &fewer, &passage).is_none());
        assert!(rejoined(&before, &part, &Passage { step: Vector3::zeros(), ..passage }).is_none());
        assert!(rejoined(&Places::default(), &part, &passage).is_none());
    }
}
