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
    let same = |candidate: &Contender, other: &Contender| {
        let place = candidate.place;
        (place - other.place).norm() < query.spacing
            && (candidate.pose.image(&place) - other.pose.image(&place)).norm() < spacings * map_spacing
            && candidate.pose.turn_to(&other.pose) < turn_rad
    };
    // Entries of rotations differ by no more than the angle between them: the same pose lies in this cell or one beside it.
    let across = (2.0 / turn_rad) as usize + 3;
    let mut kept: Vec<Contender> = Vec::new();
    let mut cells: Vec<Vec<usize>> = vec![Vec::new(); across * across];
    for candidate in candidates {
        if kept.len() == keep {
            break;
        }
        let rotation = candidate.pose.rotation.matrix();
        let [row, column] = [rotation[(0, 0)], rotation[(1, 2)]].map(|entry| ((entry + 1.0) / turn_rad) as usize + 1);
        let mut near =
            (row - 1..=row + 1).flat_map(|row| &cells[row * across + column - 1..=row * across + column + 1]);
        if !near.any(|cell| cell.iter().any(|&other| same(candidate, &kept[other]))) {
            cells[row * across + column].push(kept.len());
            kept.push(*candidate);
        }
    }
    kept
}

/// The first `most` of those that are not the `same` as one before.
pub(crate) fn first_of_each<T>(some: impl Iterator<Item = T>, most: usize, same: impl Fn(&T, &T) -> bool) -> Vec<T> {
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
