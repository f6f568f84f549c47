//! How much a settled overlap says for its pose: the log-likelihood ratio of "both visits saw these trees" to "two
//! unrelated rows", signed, every fruit predicted without its own partner.
//!
//! It is the evidence of [`super::overlap`] with the sum over all one-to-one sets of pairs in place of the nearest
//! partner, and leave-one-out predictions in place of fitted ones:
//!
//! ```text
//! S = ln sum over sets (product over pairs p u N / (rho (1 - p u) (1 - p v)))
//!   + sum over both visits ln(1 - p u) + p sum over the query u
//! ```
//!
//! p is a visit's own ([`of_either`]): pairs are as many for both, so of the visit that shows more fruits a smaller share is seen again.
//!
//! No fruit is tested on a fit that it took part in. So a wrong pose that bent towards strangers scores less here than
//! when it grew, below zero where nothing was selected.

use super::hypothesis::{DETECTION, SHARES, TURNS};
use super::pairing::Meeting;
use super::patches::{Landing, Patchwork};
use crate::beliefs::Beliefs;

/// Shares of the fruits that any pose is taken to see again. Below, a wrong pose that meets few would lose little by what it
/// misses: of rows with 15 % in common 4 of 100 were no longer found.
const SEEN_AGAIN: (f64, f64) = (0.35, 0.9);

/// Evidence of an overlap, nats.
pub(super) fn evidence(laid: &Patchwork) -> f64 {
    let map = laid.map;
    let there: Vec<f64> = (0..map.len()).map(|row| laid.looked_at(row)).collect();
    let shown = |(row, at): (usize, &Option<Landing>)| at.map_or(0.0, |at| laid.shown(row, &at.place));
    let here: Vec<f64> = laid.predictions.iter().enumerate().map(shown).collect();
    let met = laid.meetings(|meeting| Some(*meeting));
    let due = [here.iter().sum(), there.iter().sum()];
    let mut share = DETECTION;
    let mut evidence = 0.0;
    for _ in 0..TURNS {
        let [of_query, of_map] = of_either(share, due);
        let edge = |meeting: &Meeting| {
            let (seen, there) = (of_query * meeting.support, there[meeting.map as usize]);
            let strangers = map.density[meeting.map as usize] * (1.0 - seen) * (1.0 - of_map * there);
            meeting.edge(seen * meeting.density / strangers)
        };
        let beliefs = Beliefs::new(met.iter().filter_map(edge).collect(), laid.query.len(), map.len());
        let alone = |share: f64, supports: &[f64]| supports.iter().map(|u| (1.0 - share * u).ln()).sum::<f64>();
        evidence = beliefs.log_sum + alone(of_query, &here) + alone(of_map, &there) + of_query * due[0];
        let found: f64 = beliefs.probabilities.iter().sum();
        share = (found / fewer(due)).clamp(SHARES.0, SHARES.1);
    }
    evidence
}

/// Shares of the fruits that the query and the map show in an overlap which are pairs, where they show `due` fruits there and the
/// one that shows fewer has this `share` of its own in common.
///
/// Of trees that the two see with probabilities a and b, b of what the query shows is in the map and a of what the map shows in the
/// query. A frame, or a visit before the harvest, shows far from as many fruits as the other.
pub(super) fn of_either(share: f64, due: [f64; 2]) -> [f64; 2] {
    due.map(|own| share * fewer(due) / own.max(1.0))
}

fn fewer([here, there]: [f64; 2]) -> f64 {
    here.min(there).max(1.0)
}

/// The share under which evidence of this slope, which falls, is largest.
pub(super) fn likeliest_share(slope: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = SEEN_AGAIN;
    // Eight halvings of what it may be leave .002.
    for _ in 0..8 {
        let middle = 0.5 * (low + high);
        *(if slope(middle) > 0.0 { &mut low } else { &mut high }) = middle;
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Scale, Similarity};
    use crate::verified::fixture::visits;
    use crate::verified::hypothesis::Model;
    use crate::verified::landscape::Landscape;
    use nalgebra::Vector3;

    #[test]
    fn the_shares_that_the_pairs_show_make_the_evidence_largest() {
        for due @ [here, there] in [[23.0, 76.0], [76.0, 23.0], [40.0, 40.0]] {
            let found = 19.0;
            let evidence = |share: f64| {
                let [p, q] = of_either(share, due);
                found * p.ln() + (here - found) * (1.0 - p).ln() + (there - found) * (1.0 - q).ln() + p * here
            };
            let share = found / fewer(due);
            let [p, q] = of_either(share, due);
            assert!((p * here - found).abs() < 1e-9 && (q * there - found).abs() < 1e-9);
            assert!([-0.01, 0.01].iter().all(|step| evidence(share + step) < evidence(share)));
        }
    }

    #[test]
    fn the_likeliest_share_is_where_the_slope_turns_and_never_beyond_what_is_believed() {
        let (least, most) = SEEN_AGAIN;
        for turn in [least + 0.05, 0.55, most - 0.05] {
            assert!((likeliest_share(|share| turn - share) - turn).abs() < 0.002);
        }
        assert!((likeliest_share(|_| 1.0) - most).abs() < 0.002 && (likeliest_share(|_| -1.0) - least).abs() < 0.002);
    }

    #[test]
    fn the_true_pose_has_evidence_and_the_same_pose_moved_along_has_less_than_none() {
        let (query, map) = visits(0.02);
        let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
        let model = Model { sigma: 0.02, detection: DETECTION, scale: Scale::Metric, vertical: None, row: None };
        let at = |shift: Vector3<f64>| {
            let pose = Similarity { translation: query.centre - map.centre + shift, ..Similarity::identity() };
            let mut laid = Patchwork::new(&query, &map, pose, model.sigma, &model);
            laid.cells.iter_mut().for_each(|cell| cell.reached = true);
            let land = |p: &Vector3<f64>| Some(Landing { place: pose.image(p), variance: 0.02 * 0.02 });
            laid.predictions = query.points.iter().map(land).collect();
            evidence(&laid)
        };
        assert!(at(Vector3::zeros()) > 300.0);
        for step in [0.3, 0.5, 1.0] {
            assert!(at(Vector3::x() * step) < 0.0);
        }
    }
}
