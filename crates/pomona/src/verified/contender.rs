//! Poses that seeds propose, most evidence first and one of each.

use super::landscape::Landscape;
use super::placement::Placement;
use super::seeds::Quad;
use nalgebra::Vector3;

/// A seed of the query laid on a seed of the map.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contender {
    pub(crate) pose: Placement,
    pub(crate) log_odds: f64,
    pub(crate) place: Vector3<f64>,
    /// Rows of both seeds: an order for equal evidence.
    pub(super) key: (Quad, Quad),
}

/// Most evidence first.
pub(super) fn by_evidence(a: &Contender, b: &Contender) -> std::cmp::Ordering {
    b.log_odds.total_cmp(&a.log_odds).then(a.key.cmp(&b.key))
}

/// Takes the best `keep` candidates out of those given best first, one of each pose.
pub(super) fn distinct(
    query: &Landscape,
    map_spacing: f64,
    candidates: &mut Vec<Contender>,
    keep: usize,
) -> Vec<Contender> {
    let (near, same) = (query.spacing, SAME_PLACE * map_spacing);
    let mut kept: Vec<Contender> = Vec::new();
    candidates.retain(|candidate| {
        let place = candidate.place;
        let proposed = |other: &Contender| {
            (place - other.place).norm() < near
                && (candidate.pose.apply(&place) - other.pose.apply(&place)).norm() < same
                && candidate.pose.turn_to(&other.pose) < SAME_TURN_RAD
        };
        let new = kept.len() < keep && !kept.iter().any(proposed);
        if new {
            kept.push(*candidate);
        }
        !new
    });
    kept
}

/// Candidates of one neighbourhood are the same pose when they put it within this many spacings of one place, turned by
/// less than that: what one refinement reaches.
pub(super) const SAME_PLACE: f64 = 0.4;
const SAME_TURN_RAD: f64 = 0.15;
