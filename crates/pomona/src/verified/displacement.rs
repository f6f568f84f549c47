//! What a fruit's displacement shares with its neighbours': sag and drift do, noise does not.

use super::landscape::Landscape;
use nalgebra::{SMatrix, SVector, Vector3};

/// From where a fruit was put to its partner, or to the mean of all that it may be, and the probability that it has one.
pub(super) type Residual = Option<(Vector3<f64>, f64)>;

/// Variance per axis of what neighbours' residuals share: noise is independent from fruit to fruit, sag is not.
pub(super) fn shared_by_neighbours(parts: impl Iterator<Item = [f64; 2]>) -> f64 {
    let [products, pairs] = parts.fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
    if products > 0.0 { products / pairs / 3.0 } else { 0.0 }
}

/// Sums of the products of these fruits' residuals with their neighbours', and of the pairs.
pub(super) fn products(query: &Landscape, rows: &[u32], residuals: &[Residual]) -> [f64; 2] {
    let [mut products, mut pairs] = [0.0; 2];
    for &row in rows {
        let Some((own, weight)) = residuals[row as usize] else { continue };
        for (other, kinship) in query.kin(row as usize) {
            let Some((rival, other_weight)) = residuals[other as usize] else { continue };
            let kernel = weight * other_weight * kinship;
            products += kernel * own.dot(&rival);
            pairs += kernel;
        }
    }
    [products, pairs]
}

/// Neighbours that tell where a fruit has moved, at the most.
const TELLING: usize = 12;

/// How far a displacement reaches, in spacings of the query: along a branch.
const REACH: f64 = 1.5;

/// The pairs that were met are those that moved least, the more so the more neighbours move together beside the noise: the
/// others are taken to move with more of the variance that these share, by so many times its share in the noise.
const FARTHER: f64 = 10.0;

/// What a Gaussian process makes of the neighbours' residuals at a fruit, the fruit itself left out; and the variance left.
///
/// Correlations fall with the distance as `exp(-d^2 / 2 (REACH a)^2)`. A mean of the neighbours would fall short where all of them
/// are nearer the stem; this goes on as far as they say, and says how unsure it is where they are far. With K the correlations
/// and the noise, r the residuals and k the correlations with the place, the two are `k K^-1 r` and `1 - k K^-1 k`.
pub(super) fn carried_on(
    query: &Landscape,
    row: usize,
    (shared, noise): (f64, f64),
    residuals: &[Residual],
) -> (Vector3<f64>, f64) {
    if shared <= 0.0 {
        return (Vector3::zeros(), 0.0);
    }
    let variance = shared * (1.0 + FARTHER * shared / noise);
    let known = query.neighbours(row).iter().filter_map(|&other| Some((other, residuals[other as usize]?)));
    let told: Vec<(u32, (Vector3<f64>, f64))> = known.take(TELLING).collect();
    let precision = -0.5 / (REACH * query.spacing).powi(2);
    let correlation = |a: usize, b: usize| (precision * (query.points[a] - query.points[b]).norm_squared()).exp();
    // Of the symmetric matrix the part that is read; places that nobody fills stand for themselves.
    let correlations = Square::from_fn(|i, j| match told.get(i) {
        Some(&(_, (_, weight))) if i == j => 1.0 + noise / (variance * weight),
        Some(&(other, _)) if i > j => correlation(other as usize, told[j].0 as usize),
        _ => f64::from(u8::from(i == j)),
    });
    let with_place = Column::from_fn(|i, _| told.get(i).map_or(0.0, |&(other, _)| correlation(row, other as usize)));
    let Some(factor) = correlations.cholesky() else { return (Vector3::zeros(), variance) };
    let weights = factor.solve(&with_place);
    let mean = told.iter().zip(weights.iter()).map(|((_, (residual, _)), weight)| residual * *weight).sum();
    (mean, variance * (1.0 - weights.dot(&with_place)).max(0.0))
}

type Square = SMatrix<f64, TELLING, TELLING>;
type Column = SVector<f64, TELLING>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verified::fixture::visits;

    #[test]
    fn a_bend_goes_on_beyond_the_fruits_that_tell_of_it() {
        let query = Landscape::new(&visits(0.02).0);
        let bend = |p: &Vector3<f64>| Vector3::z() * (0.2 * p.x);
        let noise = 0.002f64.powi(2);
        let (mut carried, mut bent) = (0.0, 0.0);
        for row in 0..query.len() {
            let own = query.points[row];
            // Only what lies before the fruit is known.
            let known = |other: usize| (query.points[other].x < own.x).then(|| (bend(&query.points[other]), 1.0));
            let known: Vec<Residual> = (0..query.len()).map(known).collect();
            if known.iter().flatten().count() < 50 {
                continue;
            }
            carried += (carried_on(&query, row, (1e-3, noise), &known).0 - bend(&own)).norm();
            bent += bend(&own).norm();
        }
        assert!(carried < 0.1 * bent, "{carried} {bent}");
    }

    #[test]
    fn nothing_is_told_where_nobody_is_near_or_nothing_is_shared() {
        let query = Landscape::new(&visits(0.02).0);
        let (mean, left) = carried_on(&query, 0, (1e-3, 1e-4), &vec![None; query.len()]);
        assert!(mean.norm() < 1e-12 && (left - (1.0 + FARTHER * 10.0) * 1e-3).abs() < 1e-12);
        let all = vec![Some((Vector3::x(), 1.0)); query.len()];
        assert_eq!(carried_on(&query, 0, (0.0, 1e-4), &all), (Vector3::zeros(), 0.0));
    }
}
