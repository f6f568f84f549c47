//! What the residuals of a settled pose say of the errors of its sightings.
//!
//! Residuals are normal with a covariance phi D + b^2 K: D is what the covariances of sightings and map say, K =
//! exp(-d^2 / 2 r^2) in each axis what neighbours move by together. Both are fitted by restricted likelihood: the pose takes
//! up six numbers of the residuals, so that of y = W r nothing is left along J, and of K = A A^T it is
//! G = A^T (W - W J H^-1 J^T W) A. With its eigenvalues l and the parts g of A^T y along its eigenvectors,
//!
//! -2 ln p = sum of ln(phi + b^2 l) + g^2 / l / (phi + b^2 l)
//!
//! b is one number for all axes, for only across the line of sight are sightings exact enough to show it; every order of
//! magnitude of it is as likely before anyone looks, and its mean square is taken, not its best value: it is as uncertain
//! as fruits are few. A fruit that several frames saw counts once: it hangs off by the same in all of them.

use super::alignment::{Aligned, Joint, Say, UNKNOWNS};
use nalgebra::{Const, DMatrix, DVector, Dyn, OMatrix, SymmetricEigen};

/// Standard deviations that are tried for what neighbours share, metres: nothing to speak of, to a sagging branch.
const TRIED_M: [f64; 6] = [0.0005, 0.001, 0.002, 0.004, 0.008, 0.016];

/// Residuals that the covariances are believed like: standard deviations are guessed within some 30 %, variances within
/// 60, and of n squared errors the variance is known within the part sqrt(2 / n).
const BELIEVED: f64 = 6.0;

/// Least part of the told variances: below, it is the map's own fruits that are seen again.
const LEAST_SCALE: f64 = 0.1;

/// Turns of the scale and of what neighbours share, each with the other as it is.
const TURNS: usize = 3;

/// Part of the kernel's variance that may be left out at a sighting.
const LEFT_OUT: f64 = 0.2;

/// Weight below which a sighting shows a stranger.
const LEAST_WEIGHT: f64 = 0.05;

/// Turns in which eigenvalues are found, or the matrix is none of numbers.
pub(super) const EIGEN_TURNS: usize = 1000;

/// Eigenvalues, over the largest, that are none.
const NO_EIGENVALUE: f64 = 1e-6;

/// How far sightings err.
pub(super) struct Shown {
    /// Each for itself: variance over what its covariances say.
    pub scale: f64,
    /// With neighbours: variance per axis, square metres.
    pub near: f64,
}

/// Reads both out of the residuals, `covariance` being the inverse of the information.
pub(super) fn shown(aligned: &Aligned, covariance: &Joint, reach_m: f64) -> Shown {
    let says: Vec<&Say> = aligned.says.iter().filter(|say| say.weight > LEAST_WEIGHT).collect();
    let free = (3.0 * says.iter().map(|say| say.voice * say.weight).sum::<f64>() - 6.0).max(0.0);
    let squared = says.iter().map(|say| say.voice * say.squared).sum::<f64>();
    let modes = Modes::of(&says, covariance, reach_m);
    let whole: f64 = modes.eigenvalues.iter().sum();
    let scaled = |near: f64| ((squared - near * whole + BELIEVED) / (free + BELIEVED)).max(LEAST_SCALE);
    let mut found = Shown { scale: scaled(0.0), near: 0.0 };
    for _ in 0..TURNS {
        found.near = modes.mean_square(found.scale);
        found.scale = scaled(found.near);
    }
    found
}

/// What neighbours may share, in independent parts.
struct Modes {
    eigenvalues: Vec<f64>,
    /// Squared parts of the residuals along each.
    squares: Vec<f64>,
}

impl Modes {
    fn of(says: &[&Say], covariance: &Joint, reach_m: f64) -> Self {
        let columns = smooth(says, reach_m);
        let count = columns.len();
        let mut matrix = DMatrix::zeros(3 * count, 3 * count);
        let mut pulled = DVector::zeros(3 * count);
        let mut by_pose = OMatrix::<f64, Const<UNKNOWNS>, Dyn>::zeros(3 * count);
        for (row, say) in says.iter().enumerate() {
            let (information, pull) = (say.information * say.voice, say.pull * say.voice);
            let turned = say.slopes.transpose() * information;
            for (one, column) in columns.iter().enumerate() {
                for axis in 0..3 {
                    pulled[3 * one + axis] += column[row] * pull[axis];
                    by_pose.column_mut(3 * one + axis).axpy(column[row], &turned.column(axis), 1.0);
                }
                for (other, its) in columns.iter().enumerate() {
                    let mut block = matrix.fixed_view_mut::<3, 3>(3 * one, 3 * other);
                    block += information * (column[row] * its[row]);
                }
            }
        }
        let taken_up = by_pose.transpose() * covariance * by_pose;
        let Some(parts) = SymmetricEigen::try_new(matrix - taken_up, f64::EPSILON, EIGEN_TURNS) else {
            return Self { eigenvalues: Vec::new(), squares: Vec::new() };
        };
        let least = NO_EIGENVALUE * parts.eigenvalues.iter().fold(0.0, |most: f64, &one| most.max(one));
        let along = parts.eigenvectors.tr_mul(&pulled);
        let kept = || parts.eigenvalues.iter().zip(along.iter()).filter(|(value, _)| **value > least);
        Self {
            eigenvalues: kept().map(|(value, _)| *value).collect(),
            squares: kept().map(|(_, part)| part * part).collect(),
        }
    }

    /// Mean of b^2 over what is tried, each weighed by its likelihood.
    fn mean_square(&self, scale: f64) -> f64 {
        let tried = TRIED_M.map(|sigma_m| (sigma_m * sigma_m, self.log_likelihood(scale, sigma_m * sigma_m)));
        let best = tried.iter().fold(f64::NEG_INFINITY, |best, one| best.max(one.1));
        let (sum, weights) = tried.iter().fold((0.0, 0.0), |(sum, weights), (variance, nats)| {
            let weight = (nats - best).exp();
            (sum + weight * variance, weights + weight)
        });
        sum / weights
    }

    fn log_likelihood(&self, scale: f64, near: f64) -> f64 {
        let one = |(value, square): (&f64, &f64)| {
            let variance = scale + near * value;
            variance.ln() + square / value / variance
        };
        -0.5 * self.eigenvalues.iter().zip(&self.squares).map(one).sum::<f64>()
    }
}

/// Likeness of two sightings as neighbours.
pub(super) fn kinship(one: &Say, other: &Say, reach_m: f64) -> f64 {
    (-0.5 * (one.place - other.place).norm_squared() / (reach_m * reach_m)).exp()
}

/// Columns of A with A A^T = K but for a little: the incomplete Cholesky factor, the least explained sighting first.
fn smooth(says: &[&Say], reach_m: f64) -> Vec<Vec<f64>> {
    let mut left: Vec<f64> = vec![1.0; says.len()];
    let mut columns: Vec<Vec<f64>> = Vec::new();
    while columns.len() < says.len() {
        let Some(pivot) = (0..left.len()).max_by(|&one, &other| left[one].total_cmp(&left[other])) else { break };
        if left[pivot] < LEFT_OUT {
            break;
        }
        let root = left[pivot].sqrt();
        let value = |row: usize| {
            let explained: f64 = columns.iter().map(|column| column[row] * column[pivot]).sum();
            (kinship(says[row], says[pivot], reach_m) - explained) / root
        };
        let column: Vec<f64> = (0..says.len()).map(value).collect();
        for (rest, part) in left.iter_mut().zip(&column) {
            *rest -= part * part;
        }
        columns.push(column);
    }
    columns
}
