//! The last word on every fruit: one-to-one pairs with calibrated probabilities.

use super::growth::{Overlap, Prediction};
use super::hypothesis::gaussian;
use super::landscape::Landscape;
use crate::assignment::assign;
use nalgebra::{Matrix3, Vector3};

/// Edges reach to `P(chi^2_3 > 14.8)` = 0.2 %.
const GATE: f64 = 3.85;

/// One fruit of the query found again, rows of the centred clouds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Association {
    pub(crate) query: u32,
    pub(crate) map: u32,
    pub(crate) probability: f64,
    pub(crate) distance: f64,
    /// Log-odds of this pair against "new fruit", nats.
    pub(crate) gain: f64,
}

/// Rounds in which the share of fruits seen again and the noise follow from the marginals: nearest partners, which growth
/// goes by, lie closer than true ones where fruits crowd.
const ROUNDS: usize = 4;

/// Pairs whose noise is as growth found it, against those that say otherwise.
const EXPECTED_PAIRS: f64 = 12.0;

#[derive(Debug, Clone, Copy)]
struct Edge {
    query: u32,
    map: u32,
    /// Likelihood ratio of "the same fruit" against "hidden there, new here".
    ratio: f64,
    distance: f64,
    /// Squared distance over the variance along its direction.
    mahalanobis2: f64,
}

/// Pairs of an overlap.
///
/// Joint likelihood of a set of pairs: a fruit of the map is seen again with probability p, an unmatched fruit of
/// the query is new with the density of new fruits at its place. Every pair thus weighs
/// `p / (1 - p) N(d) / new density` against leaving both alone. Marginals by belief propagation (Williams and Lau
/// 2014), pairs by the assignment that gains most expected right answers.
pub(crate) fn associate(
    query: &Landscape,
    map: &Landscape,
    overlap: &Overlap,
    size: &impl Fn(u32, u32) -> f64,
    min_probability: f64,
) -> Vec<Association> {
    let (mut share, mut stretch) = (0.6, 1.0);
    let mut edges = Vec::new();
    let mut marginals = Vec::new();
    for _ in 0..ROUNDS {
        edges = edges_of(query, map, overlap, share, stretch, size);
        marginals = belief_propagation(&edges, query.len(), map.len());
        let expected: f64 =
            overlap.predictions.iter().flatten().map(|prediction| map.support(&prediction.place)).sum::<f64>().max(1.0);
        let weight: f64 = marginals.iter().sum();
        let squares: f64 = edges.iter().zip(&marginals).map(|(edge, p)| p * edge.mahalanobis2).sum();
        stretch *= (squares / 3.0 + EXPECTED_PAIRS) / (weight + EXPECTED_PAIRS);
        stretch = stretch.clamp(1.0, 4.0);
        share = ((marginals.iter().sum::<f64>() + 1.0) / (expected + 2.0)).clamp(0.2, 0.97);
    }
    let gains: Vec<(usize, usize, f64)> = edges
        .iter()
        .zip(&marginals)
        .map(|(edge, &p)| (edge.query as usize, edge.map as usize, p - min_probability))
        .collect();
    let partners = assign(query.len(), map.len(), &gains);
    let mut pairs: Vec<Association> = edges
        .iter()
        .zip(&marginals)
        .filter(|(edge, _)| partners[edge.query as usize] == Some(edge.map as usize))
        .map(|(edge, &probability)| Association {
            query: edge.query,
            map: edge.map,
            probability,
            distance: edge.distance,
            gain: edge.ratio.ln(),
        })
        .collect();
    pairs.sort_unstable_by_key(|pair| (pair.query, pair.map));
    pairs.dedup_by_key(|pair| (pair.query, pair.map));
    pairs
}

fn edges_of(
    query: &Landscape,
    map: &Landscape,
    overlap: &Overlap,
    share: f64,
    stretch: f64,
    size: &impl Fn(u32, u32) -> f64,
) -> Vec<Edge> {
    let scale = overlap.pose.scale;
    let volume_scale = scale.powi(3);
    let mut edges = Vec::new();
    for (row, prediction) in overlap.predictions.iter().enumerate() {
        let Some(Prediction { place, variance }) = *prediction else { continue };
        let variance = stretch * variance;
        let first = edges.len();
        let own = query.covariances.as_ref().map(|all| overlap.pose.turned(&all[row]));
        map.near(&place, GATE * (WIDEST * variance).sqrt(), |partner| {
            let offset = map.points[partner as usize] - place;
            let uncertain = own.zip(map.covariances.as_ref()).map(|(own, all)| own + all[partner as usize]);
            let (mahalanobis2, density) = likelihood(&offset, variance, uncertain);
            if mahalanobis2 <= GATE * GATE {
                let distance = offset.norm();
                // Fruits per cubic metre of the map that chance puts at this distance from a fruit of the map.
                let companions = 0.5 * (query.companions(distance / scale) / volume_scale + map.companions(distance));
                let new = (1.0 - share) * companions.max(map.floor);
                let ratio = share / (1.0 - share) * density / new * size(row as u32, partner);
                edges.push(Edge { query: row as u32, map: partner, ratio, distance, mahalanobis2 });
            }
        });
        // Two cells of the grid may share a bucket, which then is visited twice.
        edges[first..].sort_unstable_by_key(|edge| edge.map);
        let mut last = None;
        let mut kept = first;
        for i in first..edges.len() {
            if last != Some(edges[i].map) {
                last = Some(edges[i].map);
                edges[kept] = edges[i];
                kept += 1;
            }
        }
        edges.truncate(kept);
    }
    edges
}

/// Squared Mahalanobis distance of a residual, and its density per cubic metre.
///
/// The residuals of all pairs say how large the noise is, the fruits' own covariances which way it points: stereo
/// centroids are long along the viewing ray. `uncertain` is the sum of the two covariances; a tenth of the variance stays
/// isotropic, for what the recording does not know of (sag, growth).
fn likelihood(offset: &Vector3<f64>, variance: f64, uncertain: Option<Matrix3<f64>>) -> (f64, f64) {
    let isotropic = || {
        let d2 = offset.norm_squared();
        (d2 / variance, gaussian(d2, variance))
    };
    let Some(shape) = uncertain else { return isotropic() };
    let mean = shape.trace() / 3.0;
    if mean <= 0.0 {
        return isotropic();
    }
    let share = (mean / variance).min(0.9);
    let covariance = shape * (share * variance / mean) + Matrix3::identity() * ((1.0 - share) * variance);
    let Some(factor) = covariance.cholesky() else { return isotropic() };
    let mahalanobis2 = offset.dot(&factor.solve(offset));
    let norm = (2.0 * std::f64::consts::PI).powf(-1.5) / factor.l().diagonal().product();
    (mahalanobis2, norm * (-0.5 * mahalanobis2).exp())
}

/// Variance along the longest axis over the mean variance, at the most.
const WIDEST: f64 = 3.0;

/// Marginal probability of each edge under one-to-one association.
fn belief_propagation(edges: &[Edge], n_query: usize, n_map: usize) -> Vec<f64> {
    const ITERATIONS: usize = 40;
    let mut to_query = vec![1.0; edges.len()];
    let mut to_map = vec![0.0; edges.len()];
    for _ in 0..ITERATIONS {
        let mut sums = vec![1.0; n_query];
        for (edge, back) in edges.iter().zip(&to_query) {
            sums[edge.query as usize] += edge.ratio * back;
        }
        for ((edge, back), out) in edges.iter().zip(&to_query).zip(&mut to_map) {
            *out = edge.ratio / (sums[edge.query as usize] - edge.ratio * back).max(1e-12);
        }
        let mut sums = vec![1.0; n_map];
        for (edge, message) in edges.iter().zip(&to_map) {
            sums[edge.map as usize] += message;
        }
        let mut change = 0.0f64;
        for ((edge, message), back) in edges.iter().zip(&to_map).zip(&mut to_query) {
            let next = 1.0 / (sums[edge.map as usize] - message).max(1e-12);
            change = change.max((next - *back).abs());
            *back = next;
        }
        if change < 1e-6 {
            break;
        }
    }
    let mut sums = vec![1.0; n_query];
    for (edge, back) in edges.iter().zip(&to_query) {
        sums[edge.query as usize] += edge.ratio * back;
    }
    edges.iter().zip(&to_query).map(|(edge, back)| edge.ratio * back / sums[edge.query as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Marginals by summing over all one-to-one sets of pairs.
    fn exact(edges: &[Edge]) -> Vec<f64> {
        let mut sums = vec![0.0; edges.len()];
        let mut total = 0.0;
        for set in 0u32..1 << edges.len() {
            let chosen: Vec<usize> = (0..edges.len()).filter(|i| set >> i & 1 == 1).collect();
            let clash = chosen.iter().enumerate().any(|(at, &i)| {
                chosen[at + 1..].iter().any(|&j| edges[i].query == edges[j].query || edges[i].map == edges[j].map)
            });
            if clash {
                continue;
            }
            let weight: f64 = chosen.iter().map(|&i| edges[i].ratio).product();
            total += weight;
            for i in chosen {
                sums[i] += weight;
            }
        }
        sums.iter().map(|sum| sum / total).collect()
    }

    #[test]
    fn marginals_are_exact_on_a_tree_and_close_on_a_loop() {
        let edge = |query, map, ratio| Edge { query, map, ratio, distance: 0.0, mahalanobis2: 0.0 };
        let tree = [edge(0, 0, 5.0), edge(0, 1, 0.7), edge(1, 1, 9.0)];
        for (found, truth) in belief_propagation(&tree, 2, 2).iter().zip(exact(&tree)) {
            assert!((found - truth).abs() < 1e-6, "{found} {truth}");
        }
        let cycle = [edge(0, 0, 5.0), edge(0, 1, 2.0), edge(1, 0, 1.0), edge(1, 1, 3.0)];
        for (found, truth) in belief_propagation(&cycle, 2, 2).iter().zip(exact(&cycle)) {
            assert!((found - truth).abs() < 0.05, "{found} {truth}");
        }
    }
}
