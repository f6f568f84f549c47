//! Bundle adjustment: the poses and points that explain best what was measured.
//!
//! Measured are points in pictures (u, v, disparity), places of points in the camera's frame with their covariances, and
//! poses of one camera in another. The adjustment is the minimum of
//!
//! 1/2 `sum_k` `c_k^2` ln(1 + `m_k^2` / `c_k^2`) + 1/2 `sum_l` `e_l^T` `I_l` `e_l`,
//!
//! `m_k^2` being the squared Mahalanobis distance of an observation (Cauchy's loss: what is far off hardly pulls), `e_l` the
//! error of a relative pose and `I_l` its information; relative poses that are doubtful have Cauchy's loss too. Levenberg's and Marquardt's steps on reweighted normal equations
//! (`normal`), points eliminated, poses in a folded order (`ordering`) solved within their envelope (`envelope`):
//! time and memory grow with the length of the drive, not with its cube. One thread, no random numbers.
//!
//! The same adjustment serves a window of stereo keyframes and the fruits of a whole session; [`locate()`] finds the pose
//! of a single picture among known points.

mod envelope;
mod locate;
mod normal;
mod ordering;
mod problem;
pub(crate) mod steps;

use crate::error::{Error, Result};
use envelope::Envelope;
use nalgebra::{Matrix3, Matrix6};
use normal::Plan;

pub use locate::{KnownPoints, LocateSettings, Located, locate};
pub use problem::{Measured, PointView, Problem, RelativePose, State};

/// When an adjustment ends and how it weighs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Steps at most, for each scale.
    pub max_steps: usize,
    /// A step that lowers the cost by less than this part ends the adjustment.
    pub tolerance: f64,
    /// How many times as large c^2 is at first; it falls by tens. Where the start is many sigma off, all that is true looks
    /// false and an adjustment that begins with the final c^2 stays there (graduated non-convexity, Blake and Zisserman).
    pub first_scale: f64,
    /// Cauchy's c^2 for pictures. 5.7 loses 5 % of what Gaussian noise would let one know (Holland and Welsch, 1977).
    pub picture_scale2: f64,
    /// Cauchy's c^2 for places: 3, the mean of m^2 of a Gaussian place. The depth of a single sighting is often a leaf's.
    pub place_scale2: f64,
    /// Cauchy's c^2 for relative poses that are doubtful: 6, the mean of m^2 of a Gaussian pose.
    pub relative_scale2: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_steps: 30,
            tolerance: 1e-6,
            first_scale: 1.0,
            picture_scale2: 5.7,
            place_scale2: 3.0,
            relative_scale2: 6.0,
        }
    }
}

/// A fruit that is seen again may lie 30 sigma from where drift says: the adjustment begins with a loss that wide.
const AFTER_DRIFT: f64 = 1000.0;

impl Settings {
    /// For a session that comes back to what it has seen, its poses many sigma off.
    pub fn after_drift() -> Self {
        Self { first_scale: AFTER_DRIFT, ..Self::default() }
    }
}

/// What an adjustment found.
#[derive(Debug, Clone)]
pub struct Adjustment {
    /// Poses and points.
    pub state: State,
    /// Covariance of each point while the poses stay, square metres; zeros where nothing fixes the point.
    pub point_covariances: Vec<Matrix3<f64>>,
    /// Squared Mahalanobis distance of each observation, infinite behind the camera.
    pub squared_errors: Vec<f64>,
    /// Squared Mahalanobis distance of each relative pose.
    pub relative_squared_errors: Vec<f64>,
    /// Cost before and after.
    pub costs: [f64; 2],
    /// Steps taken.
    pub steps: usize,
    places: Vec<Option<usize>>,
    reduced: Envelope,
}

/// First damping: nearly a step of Gauss and Newton, which a good start deserves.
const DAMPING: f64 = 1e-6;

/// Where damping has stopped every step: the state is a minimum as far as rounding shows.
const MAX_DAMPING: f64 = 1e6;

/// Adjusts `initial` to the measurements.
///
/// # Errors
/// A row that does not exist, an array of another length, a number that is not finite.
pub fn adjust(problem: &Problem, initial: State, settings: &Settings) -> Result<Adjustment> {
    check(problem, &initial)?;
    let mut plan = Plan::new(problem, settings, initial.points.len());
    let first_cost = plan.cost(&initial);
    let (mut state, mut steps) = (initial, 0);
    let mut scale = settings.first_scale.max(1.0);
    loop {
        plan.scale = scale;
        steps += descend(&plan, &mut state);
        if scale <= 1.0 {
            break;
        }
        scale = (scale / 10.0).max(1.0);
    }
    let cost = plan.cost(&state);
    let last = plan.normal(&state, 0.0);
    let distance = |seen: &PointView| seen.squared_error(&problem.camera, &state).unwrap_or(f64::INFINITY);
    Ok(Adjustment {
        point_covariances: last.point_covariances(),
        squared_errors: problem.observations.iter().map(distance).collect(),
        relative_squared_errors: problem.relative_poses.iter().map(|pair| pair.squared_error(&state)).collect(),
        costs: [first_cost, cost],
        steps,
        places: plan.order.place,
        reduced: last.reduced,
        state,
    })
}

/// Steps until they no longer pay; says how many.
fn descend(plan: &Plan<'_>, state: &mut State) -> usize {
    let (mut cost, mut damping, mut steps) = (plan.cost(state), DAMPING, 0);
    while steps < plan.settings.max_steps && damping < MAX_DAMPING {
        let better = try_step(plan, state, damping).filter(|(_, next_cost)| *next_cost <= cost);
        let Some((next, next_cost)) = better else {
            damping *= 10.0;
            continue;
        };
        let settled = cost - next_cost <= plan.settings.tolerance * cost;
        (*state, cost, damping, steps) = (next, next_cost, (damping / 10.0).max(DAMPING), steps + 1);
        if settled {
            break;
        }
    }
    steps
}

fn try_step(plan: &Plan<'_>, state: &State, damping: f64) -> Option<(State, f64)> {
    let mut normal = plan.normal(state, damping);
    let reduced = std::mem::replace(&mut normal.reduced, Envelope::zeros(Vec::new()));
    let mut step = normal.right.clone();
    reduced.cholesky()?.solve(&mut step);
    let next = plan.stepped(state, &normal, &step);
    let cost = plan.cost(&next);
    cost.is_finite().then_some((next, cost))
}

impl Adjustment {
    /// Information of second poses relative to first ones, points and all other poses free: the inverse covariance of
    /// the step (translation, rotation) of the second camera in its own frame.
    ///
    /// `None` for a pair that no point and no measurement connects, and for two fixed poses.
    pub fn relative_information(&self, pairs: &[(usize, usize)]) -> Vec<Option<Matrix6<f64>>> {
        let Some(factor) = self.reduced.clone().cholesky() else { return vec![None; pairs.len()] };
        let covariances = factor.inverse();
        pairs.iter().map(|&pair| self.information(&covariances, pair)).collect()
    }

    /// Covariance of each pose, points and all other poses free: of its step (translation, rotation) in its own frame.
    ///
    /// Zeros for fixed poses; `None` where what was measured does not hold all poses.
    pub fn pose_covariances(&self) -> Option<Vec<Matrix6<f64>>> {
        let covariances = self.reduced.clone().cholesky()?.inverse();
        let of = |place: &Option<usize>| place.map_or_else(Matrix6::zeros, |place| *covariances.block(place, place));
        Some(self.places.iter().map(of).collect())
    }

    fn information(&self, covariances: &Envelope, (first, second): (usize, usize)) -> Option<Matrix6<f64>> {
        let predicted = self.state.poses[second].seen_from(&self.state.poses[first]);
        let carried = steps::carried(&predicted);
        let covariance = match (self.places[first], self.places[second]) {
            (None, None) => return None,
            (None, Some(second)) => *covariances.block(second, second),
            (Some(first), None) => carried * covariances.block(first, first) * carried.transpose(),
            (Some(first), Some(second)) => {
                let (row, column) = (first.max(second), first.min(second));
                if !covariances.holds(row, column) {
                    return None;
                }
                let both = covariances.block(row, column);
                let mixed = carried * if first > second { *both } else { both.transpose() };
                carried * covariances.block(first, first) * carried.transpose() + covariances.block(second, second)
                    - mixed
                    - mixed.transpose()
            }
        };
        covariance.cholesky().map(|factor| factor.inverse())
    }
}

fn check(problem: &Problem, state: &State) -> Result<()> {
    let (poses, points) = (state.poses.len(), state.points.len());
    if problem.fixed.len() != poses {
        return Err(Error::Length { what: "fixed", found: problem.fixed.len(), expected: poses });
    }
    let row = |what: &'static str, found: usize, below: usize| {
        if found < below { Ok(()) } else { Err(Error::Row { what, found, below }) }
    };
    for seen in &problem.observations {
        row("observations.pose", seen.pose, poses)?;
        row("observations.point", seen.point, points)?;
    }
    for pair in &problem.relative_poses {
        row("relative_poses.first", pair.first, poses)?;
        row("relative_poses.second", pair.second, poses)?;
    }
    check_finite(problem, state)
}

fn check_finite(problem: &Problem, state: &State) -> Result<()> {
    let seen = |seen: &PointView| {
        let (Measured::Picture(value) | Measured::Place(value)) = seen.measured;
        (seen.whitening.sum() + value.sum()).is_finite()
    };
    let relative =
        |pair: &RelativePose| (pair.information.sum() + pair.first_from_second.to_matrix().sum()).is_finite();
    let wrong = [
        ("points", state.points.iter().position(|point| !point.coords.sum().is_finite())),
        ("poses", state.poses.iter().position(|pose| !pose.to_matrix().sum().is_finite())),
        ("observations", problem.observations.iter().position(|one| !seen(one))),
        ("relative_poses", problem.relative_poses.iter().position(|one| !relative(one))),
    ];
    let found = wrong.into_iter().find_map(|(what, row)| Some(Error::NotFinite { what, row: row? }));
    found.map_or(Ok(()), Err)
}

#[cfg(test)]
mod tests;
