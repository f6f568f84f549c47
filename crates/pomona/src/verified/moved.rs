//! The row moved along itself: what this planting gives to poses that are wrong for sure.
//!
//! Where fruits hang at equal distances, along thin wires or on trees of one clone, a wrong pose lays them on each other nearly as well
//! as the best one, and so it does when it is moved by as much again. Where a pose is right, nothing is left of its evidence there.

use super::case::Finding;
use super::contender::first_of_each;
use super::doubts::is_most;
use super::evidence::evidence_within;
use super::layers::BEYOND_A_CLUSTER;
use super::overlap::Overlap;
use super::patches::{Landing, Patchwork};
use super::seeds::STARS;
use super::translations::{WIDTH, most_common};
use nalgebra::Vector3;
use rayon::prelude::*;

/// No pose that is moved may have this share of the evidence. Of 865 true answers of the test cells two have it, .37, of 19 wrong ones on
/// walls of single fruits all, .40 and more, and of 155 on an outsider's clips all, .49 and more.
const PATTERN_SHARE: f64 = 0.35;

/// Standard deviations within which pairs of a pose that is moved count: beyond, all of them together say a few nats, and are five in six.
const NEAR: f64 = 4.0;

/// Spacings that a pose is moved at the most: in a long row a pattern shows within a few trees.
const FARTHEST: f64 = 16.0;

/// Pairs that say which ways are tried, at the most; and the ways by which most of their fruits come on others that are tried.
const PAIRS_ASKED: usize = 64;
const TRIED: usize = 32;

impl Finding<'_> {
    /// Where a settled finding with less evidence than is `clear`, nats, keeps much of it when it is moved by what lays its pairs on other
    /// fruits of the map, and that is no other pose that is `known`: the translations, and its evidence there, nats.
    pub(super) fn fits_moved(
        &self,
        clear: f64,
        known: impl Fn(&[Option<Landing>]) -> bool + Sync,
    ) -> Vec<(Vector3<f64>, f64)> {
        let unsure = self.settled.as_ref().filter(|_| self.overlap.log_odds < clear);
        let Some(settled) = unsure else { return Vec::new() };
        let map = self.growth.patches.map;
        let believed = settled.beliefs.links().filter(|(_, probability)| *probability > 0.5);
        let pairs: Vec<Vector3<f64>> = believed.map(|(edge, _)| map.points[edge.map as usize]).collect();
        let Overlap { pose, sigma, predictions, .. } = settled.overlap.clone();
        let direction = settled.direction.clone();
        let laid = Patchwork { pose, sigma, direction, predictions, ..self.growth.patches.clone() };
        let kept = kept_moved(&laid, &ways(&laid, &pairs), PATTERN_SHARE * settled.evidence, known);
        // Two cells of translations may share one.
        let same = |one: &(Vector3<f64>, f64), other: &(Vector3<f64>, f64)| {
            (one.0 - other.0).norm() < BEYOND_A_CLUSTER * map.spacing
        };
        first_of_each(kept.into_iter(), usize::MAX, same)
    }
}

/// Ways to move an overlap that lay its pairs on other fruits of the map, farther than a cluster is wide.
fn ways(laid: &Patchwork, pairs: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let map = laid.map;
    let [least, farthest] = [BEYOND_A_CLUSTER, FARTHEST].map(|spacings| spacings * map.spacing);
    let asked = pairs.iter().copied().step_by(pairs.len().div_ceil(PAIRS_ASKED).max(1));
    most_common(asked, map, farthest, WIDTH * laid.sigma).filter(|by| by.norm() > least).take(TRIED).collect()
}

/// The ways by which all predictions of a settled pose are moved and it has more than so much evidence, with that, as far as most of what
/// the map has shown is still expected.
fn kept_moved(
    laid: &Patchwork,
    ways: &[Vector3<f64>],
    most: f64,
    known: impl Fn(&[Option<Landing>]) -> bool + Sync,
) -> Vec<(Vector3<f64>, f64)> {
    let expected = due(laid);
    let kept = |there: &mut Patchwork, by: &Vector3<f64>| {
        there.pose.translation = laid.pose.translation + by;
        let moved = |at: &Landing| Landing { place: at.place + by, ..*at };
        there.predictions = laid.predictions.iter().map(|at| at.as_ref().map(moved)).collect();
        if !is_most(due(there) / expected) {
            return None;
        }
        // Fewer pairs than a pose has at least are two or three fruits that meet by chance: a third of the evidence of ten.
        let (nats, found) = evidence_within(NEAR, there);
        (nats > most && found > STARS as f64 && !known(&there.predictions)).then_some((*by, nats))
    };
    ways.par_iter().map_init(|| laid.clone(), kept).flatten_iter().collect()
}

/// Fruits that the map should have shown.
fn due(laid: &Patchwork) -> f64 {
    laid.due().iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::geometry::{Scale, Similarity};
    use crate::verified::fixture::{Dice, visits};
    use crate::verified::hypothesis::{DETECTION, Model};
    use crate::verified::landscape::Landscape;

    /// Whether the query, laid where it was drawn, keeps so much of its evidence when it is moved.
    fn keeps([query, map]: [FruitCloud; 2], share: f64) -> bool {
        let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
        let model = Model { sigma: 0.02, detection: DETECTION, scale: Scale::Metric, vertical: None, row: None };
        let pose = Similarity { translation: query.centre - map.centre, ..Similarity::identity() };
        let mut laid = Patchwork::new(&query, &map, pose, model.sigma, &model);
        laid.cells.iter_mut().for_each(|cell| cell.reached = true);
        let land = |p: &Vector3<f64>| Some(Landing { place: pose.image(p), variance: 0.02 * 0.02 });
        laid.predictions = query.points.iter().map(land).collect();
        let ways = ways(&laid, &map.points);
        assert!(!ways.is_empty());
        !kept_moved(&laid, &ways, share * evidence_within(NEAR, &laid).0, |_| false).is_empty()
    }

    #[test]
    fn a_crown_that_is_moved_loses_its_evidence() {
        assert!(!keeps(visits(0.02).into(), 0.05));
    }

    #[test]
    fn three_fruits_of_a_dozen_that_meet_when_it_is_moved_are_no_pattern() {
        let mut dice = Dice(3);
        let mut fruits: Vec<Vector3<f64>> =
            (0..9).map(|_| Vector3::new(1.5 * dice.uniform(), 0.0, 1.2 * dice.uniform())).collect();
        let copied: Vec<_> = fruits[..3].iter().map(|p| p + 0.9 * Vector3::x()).collect();
        fruits.extend(copied);
        let visit = || FruitCloud::from_positions(fruits.iter().map(|&p| p.into()).collect());
        assert!(!keeps([visit(), visit()], 0.1));
    }

    #[test]
    fn fruits_at_equal_distances_keep_most_of_it() {
        let mut dice = Dice(5);
        let mut visit = || {
            let spur = |i: usize| Vector3::new(0.2 * (i % 30) as f64, 0.0, 0.4 * (i / 30) as f64);
            let spurs = (0..120).map(|i| (spur(i) + 0.02 * dice.normal()).into()).collect();
            FruitCloud::from_positions(spurs)
        };
        assert!(keeps([visit(), visit()], PATTERN_SHARE));
    }
}
