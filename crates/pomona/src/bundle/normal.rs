//! The normal equations of one step, points eliminated.
//!
//! With the blocks U of the poses, V of the points and W between them, the step of the poses solves
//! (U - W V^-1 W^T) dx = a - W V^-1 b, and that of the points is V^-1 (b - W^T dx) (the Schur complement; Triggs et al.,
//! Bundle adjustment - a modern synthesis, 2000, section 6.1). V is block diagonal, one 3 x 3 block a point.

use super::Settings;
use super::envelope::Envelope;
use super::ordering::Order;
use super::problem::{Measured, PointView, Problem, RelativePose, State};
use super::steps::moved;
use nalgebra::{Matrix3, Matrix6, Matrix6x3, Vector3, Vector6};

/// Observations by point, and the order of the poses: what stays the same from step to step.
pub(super) struct Plan<'a> {
    pub problem: &'a Problem,
    pub settings: &'a Settings,
    pub order: Order,
    /// How many times as large Cauchy's c^2 is for now.
    pub scale: f64,
    by_point: Vec<PointView>,
    start: Vec<usize>,
}

/// The equations of one step.
pub(super) struct NormalEquations {
    pub reduced: Envelope,
    pub right: Vec<Vector6<f64>>,
    points: Vec<EliminatedPoint>,
    couplings: Vec<(usize, Matrix6x3<f64>)>,
}

struct EliminatedPoint {
    inverse: Matrix3<f64>,
    right: Vector3<f64>,
    couplings_end: usize,
}

impl<'a> Plan<'a> {
    pub(super) fn new(problem: &'a Problem, settings: &'a Settings, n_points: usize) -> Self {
        let mut start = vec![0; n_points + 1];
        for seen in &problem.observations {
            start[seen.point + 1] += 1;
        }
        for point in 0..n_points {
            start[point + 1] += start[point];
        }
        let mut by_point = problem.observations.clone();
        by_point.sort_by_key(|seen| seen.point);
        Self { problem, settings, order: super::ordering::order(problem, n_points), scale: 1.0, by_point, start }
    }

    /// Half the robust cost of a state.
    pub(super) fn cost(&self, state: &State) -> f64 {
        let seen: f64 = self.by_point.iter().map(|seen| self.loss(seen, state).0).sum();
        let relative: f64 = self.problem.relative_poses.iter().map(|pair| self.relative_loss(pair, state).0).sum();
        0.5 * (seen + relative)
    }

    /// Cauchy's loss c^2 ln(1 + m^2 / c^2) and its slope by m^2, the weight of the observation.
    pub(super) fn loss(&self, seen: &PointView, state: &State) -> (f64, f64) {
        let scale2 = match seen.measured {
            Measured::Picture(_) => self.settings.picture_scale2,
            Measured::Place(_) => self.settings.place_scale2,
        } * self.scale;
        cauchy(seen.squared_error(&self.problem.camera, state).unwrap_or(BEHIND), scale2)
    }

    /// The same of a relative pose; one that is not doubtful weighs in full.
    fn relative_loss(&self, pair: &RelativePose, state: &State) -> (f64, f64) {
        let squared = pair.squared_error(state);
        if pair.doubtful { cauchy(squared, self.settings.relative_scale2 * self.scale) } else { (squared, 1.0) }
    }

    /// The equations at a state; `damping` is added to the diagonal in proportion to it (Marquardt, 1963).
    pub(super) fn normal(&self, state: &State, damping: f64) -> NormalEquations {
        let n = self.order.first.len();
        let mut normal = NormalEquations {
            reduced: Envelope::zeros(self.order.first.clone()),
            right: vec![Vector6::zeros(); n],
            points: Vec::with_capacity(state.points.len()),
            couplings: Vec::with_capacity(self.by_point.len()),
        };
        let mut diagonal = vec![Matrix6::zeros(); n];
        self.add_relative_poses(state, &mut normal, &mut diagonal);
        for point in 0..state.points.len() {
            self.eliminate(point, state, damping, &mut normal, &mut diagonal);
        }
        for (place, mut block) in diagonal.into_iter().enumerate() {
            for axis in 0..6 {
                block[(axis, axis)] += damping * block[(axis, axis)] + FLOOR;
            }
            *normal.reduced.block_mut(place, place) += block;
        }
        normal
    }

    fn add_relative_poses(&self, state: &State, normal: &mut NormalEquations, diagonal: &mut [Matrix6<f64>]) {
        for pair in &self.problem.relative_poses {
            let (error, by_first, by_second) = pair.linear(state);
            let information = pair.information * self.relative_loss(pair, state).1;
            let places = [self.order.place[pair.first], self.order.place[pair.second]];
            for (place, slope) in places.iter().zip([&by_first, &by_second]) {
                if let Some(place) = *place {
                    diagonal[place] += slope.tr_mul(&(information * slope));
                    normal.right[place] -= slope.tr_mul(&(information * error));
                }
            }
            if let [Some(first), Some(second)] = places {
                let mixed = by_first.tr_mul(&(information * by_second));
                let (row, column, block) =
                    if first > second { (first, second, mixed) } else { (second, first, mixed.transpose()) };
                *normal.reduced.block_mut(row, column) += block;
            }
        }
    }

    fn eliminate(
        &self,
        point: usize,
        state: &State,
        damping: f64,
        normal: &mut NormalEquations,
        diagonal: &mut [Matrix6<f64>],
    ) {
        let (mut block, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let couplings_start = normal.couplings.len();
        for seen in &self.by_point[self.start[point]..self.start[point + 1]] {
            let Some(linear) = seen.linear(&self.problem.camera, state) else { continue };
            let weight = self.loss(seen, state).1;
            let by_point = linear.by_point.transpose() * weight;
            block += by_point * linear.by_point;
            right -= by_point * linear.residual;
            if let Some(place) = self.order.place[seen.pose] {
                let by_pose = linear.by_pose.transpose() * weight;
                diagonal[place] += by_pose * linear.by_pose;
                normal.right[place] -= by_pose * linear.residual;
                normal.couplings.push((place, by_pose * linear.by_point));
            }
        }
        for axis in 0..3 {
            block[(axis, axis)] *= 1.0 + damping;
        }
        // A point that its observations do not fix stays where it is and holds nothing.
        let inverse = block.cholesky().map_or_else(Matrix3::zeros, |factor| factor.inverse());
        for (row, coupling) in &normal.couplings[couplings_start..] {
            let reduced = coupling * inverse;
            normal.right[*row] -= reduced * right;
            for (column, other) in normal.couplings[couplings_start..].iter().filter(|(column, _)| column <= row) {
                *normal.reduced.block_mut(*row, *column) -= reduced * other.transpose();
            }
        }
        normal.points.push(EliminatedPoint { inverse, right, couplings_end: normal.couplings.len() });
    }

    /// The state after the step of the poses `step`, points following.
    pub(super) fn stepped(&self, state: &State, normal: &NormalEquations, step: &[Vector6<f64>]) -> State {
        let mut next = state.clone();
        for (pose, place) in next.poses.iter_mut().zip(&self.order.place) {
            if let Some(place) = *place {
                *pose = moved(pose, &step[place]);
            }
        }
        let mut begin = 0;
        for (point, eliminated) in next.points.iter_mut().zip(&normal.points) {
            let mut right = eliminated.right;
            for (place, coupling) in &normal.couplings[begin..eliminated.couplings_end] {
                right -= coupling.tr_mul(&step[*place]);
            }
            *point += eliminated.inverse * right;
            begin = eliminated.couplings_end;
        }
        next
    }
}

impl NormalEquations {
    /// Covariances of the points while the poses stay.
    pub(super) fn point_covariances(&self) -> Vec<Matrix3<f64>> {
        self.points.iter().map(|point| point.inverse).collect()
    }
}

/// Cauchy's loss of a squared distance, and its slope by it.
fn cauchy(squared: f64, scale2: f64) -> (f64, f64) {
    (scale2 * (squared / scale2).ln_1p(), 1.0 / (1.0 + squared / scale2))
}

/// What a point behind its camera counts: far outside every gate, yet finite, so that a step that brings it to the front
/// is a better one.
const BEHIND: f64 = 1e6;

/// Keeps a pose that nothing was measured of at its place; a metre of it weighs as much as a thousandth of a sigma.
const FLOOR: f64 = 1e-6;
