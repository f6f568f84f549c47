//! What a fruit's displacement shares with its neighbours': sag and drift do, noise does not.

use super::landscape::Landscape;
use super::nearest::SHARE_OF_ROWS;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Pairs below which residuals say nothing about what neighbours share.
const MIN_AGREEING: f64 = 20.0;

/// Variance per axis of what neighbours' residuals share: noise is independent from fruit to fruit, sag is not.
///
/// `residual` gives a fruit's residual and its weight.
pub(super) fn shared_by_neighbours(
    query: &Landscape,
    residual: impl Fn(usize) -> Option<(Vector3<f64>, f64)> + Sync,
) -> f64 {
    let rows: Vec<usize> = (0..query.len()).collect();
    let parts: Vec<[f64; 3]> = rows
        .par_chunks(SHARE_OF_ROWS)
        .map(|rows| {
            let [mut products, mut pairs, mut weights] = [0.0; 3];
            for &row in rows {
                let Some((own, weight)) = residual(row) else { continue };
                weights += weight;
                for (other, kinship) in query.kin(row) {
                    let Some((rival, other_weight)) = residual(other as usize) else { continue };
                    let kernel = weight * other_weight * kinship;
                    products += kernel * own.dot(&rival);
                    pairs += kernel;
                }
            }
            [products, pairs, weights]
        })
        .collect();
    let [products, pairs, weights] = parts.iter().fold([0.0; 3], |sum, part| [0, 1, 2].map(|i| sum[i] + part[i]));
    if weights > MIN_AGREEING && pairs > 0.0 { (products / pairs / 3.0).max(0.0) } else { 0.0 }
}

/// Mean residual of the neighbours, the fruit itself left out, shrunk by the noise; and the variance left.
pub(super) fn displacement(
    query: &Landscape,
    row: usize,
    (shared, noise): (f64, f64),
    residual: impl Fn(usize) -> Option<(Vector3<f64>, f64)>,
) -> (Vector3<f64>, f64) {
    if shared <= 0.0 {
        return (Vector3::zeros(), 0.0);
    }
    let (mut sum, mut total) = (Vector3::zeros(), 0.0);
    for (other, kinship) in query.kin(row) {
        if let Some((residual, weight)) = residual(other as usize) {
            sum += residual * (weight * kinship);
            total += weight * kinship;
        }
    }
    let ratio = noise / shared;
    (sum / (total + ratio), noise / (total + ratio))
}
