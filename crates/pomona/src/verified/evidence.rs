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
//! p is a visit's own ([`super::shares`]): pairs are as many for both, so of the visit that shows more fruits a smaller share is seen again.
//!
//! No fruit is tested on a fit that it took part in. So a wrong pose that bent towards strangers scores less here than
//! when it grew, below zero where nothing was selected.

use super::hypothesis::{DETECTION, SHARES, TURNS};
use super::pairing::{GATE, Meeting};
use super::patches::Patchwork;
use super::shares::{fewer, of_either};
use crate::beliefs::Beliefs;

/// Evidence of an overlap, nats.
pub(super) fn evidence(laid: &Patchwork) -> f64 {
    evidence_within(GATE, laid)
}

/// The same of pairs within so many standard deviations alone.
pub(super) fn evidence_within(gate: f64, laid: &Patchwork) -> f64 {
    let map = laid.map;
    let there: Vec<f64> = laid.within_reach().map(|row| laid.looked_at(row as usize)).collect();
    let here = laid.due();
    let met = laid.meetings(gate, |meeting| Some((*meeting, laid.looked_at(meeting.map as usize))));
    let due = [here.iter().sum(), there.iter().sum()];
    let mut share = DETECTION;
    let mut evidence = 0.0;
    for _ in 0..TURNS {
        let [of_query, of_map] = of_either(share, due);
        let edge = |(meeting, there): &(Meeting, f64)| {
            let seen = of_query * meeting.support;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Scale, Similarity};
    use crate::verified::fixture::visits;
    use crate::verified::hypothesis::Model;
    use crate::verified::landscape::Landscape;
    use crate::verified::patches::Landing;
    use nalgebra::Vector3;

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
