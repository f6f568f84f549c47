//! Poses that seeds propose, most evidence first and one of each.

use super::landscape::Landscape;
use super::seeds::Quad;
use crate::geometry::Similarity;
use nalgebra::Vector3;

/// A seed of the query laid on a seed of the map.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contender {
    pub(crate) pose: Similarity,
    pub(crate) log_odds: f64,
    pub(crate) place: Vector3<f64>,
    /// Rows of both seeds: an order for equal evidence.
    pub(super) key: (Quad, Quad),
}

/// Most evidence first.
pub(super) fn by_evidence(a: &Contender, b: &Contender) -> std::cmp::Ordering {
    b.log_odds.total_cmp(&a.log_odds).then(a.key.cmp(&b.key))
}

/// Candidates that are refined of those that a search proposes at a time.
pub(super) const REFINED: usize = 48;

/// The best `keep` candidates of those given best first, one of each pose.
pub(super) fn distinct(query: &Landscape, map_spacing: f64, candidates: &[Contender], keep: usize) -> Vec<Contender> {
    let (spacings, turn_rad) = SAME;
    first_of_each(candidates.iter().copied(), keep, |candidate, other| {
        let place = candidate.place;
        (place - other.place).norm() < query.spacing
            && (candidate.pose.image(&place) - other.pose.image(&place)).norm() < spacings * map_spacing
            && candidate.pose.turn_to(&other.pose) < turn_rad
    })
}

/// The first `most` of those that are not the `same` as one before.
pub(super) fn first_of_each<T>(some: impl Iterator<Item = T>, most: usize, same: impl Fn(&T, &T) -> bool) -> Vec<T> {
    let mut kept: Vec<T> = Vec::new();
    for one in some {
        if kept.len() == most {
            break;
        }
        if !kept.iter().any(|other| same(&one, other)) {
            kept.push(one);
        }
    }
    kept
}

/// Candidates of one neighbourhood are the same pose when they put it within this many spacings of one place, turned by
/// less than this many radians: what one refinement reaches.
pub(super) const SAME: (f64, f64) = (0.4, 0.15);
