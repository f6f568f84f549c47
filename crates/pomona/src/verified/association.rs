//! The last word on every fruit: one-to-one pairs with calibrated probabilities.

use super::growth::{Overlap, Prediction};
use super::hypothesis::gaussian;
use super::landscape::Landscape;
use crate::assignment::assign;

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

#[derive(Debug, Clone, Copy)]
struct Edge {
    query: u32,
    map: u32,
    /// Likelihood ratio of "the same fruit" against "hidden there, new here".
    ratio: f64,
    distance: f64,
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
    let mut share = 0.6;
    let mut edges = Vec::new();
    let mut marginals = Vec::new();
    // Two rounds: the share of fruits seen again is estimated from the marginals of the first.
    for _ in 0..2 {
        edges = edges_of(query, map, overlap, share, size);
        marginals = belief_propagation(&edges, query.len(), map.len());
        let expected: f64 =
            overlap.predictions.iter().flatten().map(|prediction| map.support(&prediction.place)).sum::<f64>().max(1.0);
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
    size: &impl Fn(u32, u32) -> f64,
) -> Vec<Edge> {
    let scale = overlap.pose.scale;
    let volume_scale = scale.powi(3);
    let mut edges = Vec::new();
    for (row, prediction) in overlap.predictions.iter().enumerate() {
        let Some(Prediction { place, variance }) = *prediction else { continue };
        let gate2 = GATE * GATE * variance;
        let first = edges.len();
        map.near(&place, gate2.sqrt(), |partner| {
            let d2 = (map.points[partner as usize] - place).norm_squared();
            if d2 <= gate2 {
                let distance = d2.sqrt();
                // Fruits per cubic metre of the map that chance puts at this distance from a fruit of the map.
                let companions = 0.5 * (query.companions(distance / scale) / volume_scale + map.companions(distance));
                let new = (1.0 - share) * companions.max(map.floor);
                let ratio = share / (1.0 - share) * gaussian(d2, variance) / new * size(row as u32, partner);
                edges.push(Edge { query: row as u32, map: partner, ratio, distance });
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
