//! How surely a pose is known when fruits do not err independently.
//!
//! The pose is a weighted mean of what n sightings say, with gains G = H^-1 J^T W. Independent errors average out and leave
//! H^-1. Errors that neighbours share do not: the covariance is `H^-1 + H^-1 (sum over i, k of U_i C_ik U_k^T) H^-1` with
//! `U = J^T W`, and `C_ik = s^2 exp(-d^2 / 2 r^2)` of two sightings d apart; two sightings of one fruit also share where it
//! hangs.

use super::alignment::{Aligned, Say};
use super::known::KnownFruits;
use nalgebra::{Matrix3, Matrix6, Matrix6x3};

/// Pairs below which residuals say nothing about what neighbours share.
const MIN_SHARED: f64 = 20.0;

/// Covariance of the pose's step.
pub(super) fn covariance(aligned: &Aligned, map: &KnownFruits, shared_m: f64, reach_m: f64) -> Option<Matrix6<f64>> {
    let alone = aligned.information.cholesky()?.inverse();
    let variance = (shared_m * shared_m).max(shown(&aligned.says, reach_m));
    let pulls: Vec<(&Say, Matrix6x3<f64>)> =
        aligned.says.iter().map(|say| (say, say.by_pose.transpose() * say.information)).collect();
    let mut middle = Matrix6::zeros();
    for (i, (one, pull)) in pulls.iter().enumerate() {
        let mut sum = pull.transpose() * (0.5 * variance);
        for (other, its) in &pulls[i + 1..] {
            sum += common(one, other, map, variance, reach_m) * its.transpose();
        }
        let half = pull * sum;
        middle += half + half.transpose();
    }
    Some(alone * aligned.spread.max(1.0) + alone * middle * alone)
}

/// Covariance of the errors of two sightings with each other.
fn common(one: &Say, other: &Say, map: &KnownFruits, variance: f64, reach_m: f64) -> Matrix3<f64> {
    let near = Matrix3::from_diagonal_element(variance * kinship(one, other, reach_m));
    match (one.best, other.best) {
        (Some(row), Some(same)) if row == same => near + map.covariances[row],
        _ => near,
    }
}

fn kinship(one: &Say, other: &Say, reach_m: f64) -> f64 {
    (-0.5 * (one.place - other.place).norm_squared() / (reach_m * reach_m)).exp()
}

/// Variance per axis that neighbours' residuals share, square metres, of what the pose has not taken up.
fn shown(says: &[Say], reach_m: f64) -> f64 {
    let (mut products, mut pairs, mut weights) = (0.0, 0.0, 0.0);
    for (i, one) in says.iter().enumerate() {
        weights += one.weight;
        for other in &says[i + 1..] {
            if one.best != other.best {
                let kernel = one.weight * other.weight * kinship(one, other, reach_m);
                products += kernel * one.residual.dot(&other.residual);
                pairs += kernel;
            }
        }
    }
    if weights > MIN_SHARED && pairs > 0.0 { (products / pairs / 3.0).max(0.0) } else { 0.0 }
}
