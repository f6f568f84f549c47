//! The row moved along itself: what this planting gives to poses that are wrong for sure.
//!
//! Where fruits hang at equal distances, along thin wires or on trees of one clone, a wrong pose lays them on each other nearly as well
//! as the best one, and so it does when it is moved by as much again. Where a pose is right, nothing is left of its evidence there.

use super::case::Finding;
use super::contender::first_of_each;
use super::doubts::is_most;
use super::evidence::evidence_within;
use super::landscape::Landscape;
use super::layers::BEYOND_A_CLUSTER;
use super::overlap::Overlap;
use super::pairing::GATE;
use super::patches::{Landing, Patchwork};
use super::seeds::STARS;
use super::settlement::Settled;
use super::translations::{WIDTH, most_common};
use crate::principal::Principal;
use nalgebra::Vector3;
use rayon::prelude::*;

/// No pose that is moved may have this share of the evidence. Of 865 true answers of the test cells two have it, .37, of 19 wrong ones on
/// walls of single fruits all, .40 and more, and of 155 on an outsider's clips all, .49 and more.
const PATTERN_SHARE: f64 = 0.35;

/// Standard deviations within which pairs of a pose that is moved count: beyond, all of them together say a few nats, and are five in six.
const NEAR: f64 = 4.0;

/// Distances either way along the row that the pose is moved by, evenly; and how many places in all have to show most of the fruits, so that
/// they tell what this planting gives.
const STEPS: usize = 24;
const LEAST_PLACES: usize = 8;

/// Spacings that a pose is moved at the most: in a long row a pattern shows within a few trees.
const FARTHEST: f64 = 16.0;

/// Pairs that say which ways are tried, at the most; and the ways by which most of their fruits come on others that are tried.
const PAIRS_ASKED: usize = 64;
const TRIED: usize = 32;

impl Finding<'_> {
    /// By how many standard deviations a settled finding has more evidence than it has where it is moved, along the row and by what lays
    /// its pairs on other fruits of the map.
    ///
    /// There it is wrong for sure, and meets what wrong poses meet on this very planting: on crowns each fruit speaks against it, on long
    /// wires, where neighbours are as near as noise is wide, hundreds of fruits may speak for it a little, and trees of one clone lie on
    /// each other. None where the map shows too few such places.
    pub(super) fn deviations_from_moved(&self) -> Option<f64> {
        let settled = self.settled.as_ref()?;
        let laid = self.laid(settled);
        deviations(&laid, settled.evidence, &self.pairs_in_map(settled))
    }

    /// Where in the map the pairs are that are likelier right than wrong.
    fn pairs_in_map(&self, settled: &Settled) -> Vec<Vector3<f64>> {
        let map = self.growth.patches.map;
        let believed = settled.beliefs.links().filter(|(_, probability)| *probability > 0.5);
        believed.map(|(edge, _)| map.points[edge.map as usize]).collect()
    }

    /// The query as it is laid once it is settled.
    fn laid(&self, settled: &Settled) -> Patchwork<'_> {
        let Overlap { pose, sigma, predictions, .. } = settled.overlap.clone();
        let direction = settled.direction.clone();
        Patchwork { pose, sigma, direction, predictions, ..self.growth.patches.clone() }
    }

    /// Where a settled finding with less evidence than is `clear`, nats, keeps much of it when it is moved by what lays its pairs on other
    /// fruits of the map, and that is no other pose that is `known`: the translations, and its evidence there, nats.
    pub(super) fn fits_moved(
        &self,
        clear: f64,
        known: impl Fn(&[Option<Landing>]) -> bool + Sync,
    ) -> Vec<(Vector3<f64>, f64)> {
        let unsure = self.settled.as_ref().filter(|_| self.overlap.log_odds < clear);
        let Some(settled) = unsure else { return Vec::new() };
        let laid = self.laid(settled);
        let kept =
            kept_moved(&laid, &ways(&laid, &self.pairs_in_map(settled)), PATTERN_SHARE * settled.evidence, known);
        // Two cells of translations may share one.
        let same = |one: &(Vector3<f64>, f64), other: &(Vector3<f64>, f64)| {
            (one.0 - other.0).norm() < BEYOND_A_CLUSTER * laid.map.spacing
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

/// By how many standard deviations `evidence` is more than that of the pose moved.
///
/// The one place with most of it is left out, for that may be a second tree that looks the same: a rival, and no pattern.
fn deviations(laid: &Patchwork, evidence: f64, pairs: &[Vector3<f64>]) -> Option<f64> {
    let mut ways = ways(laid, pairs);
    ways.extend(along_the_row(laid.map)?);
    let found = ways.iter().zip(moved(laid, &ways, GATE)).filter_map(|(by, moved)| Some((by, moved?.0)));
    let mut found: Vec<(&Vector3<f64>, f64)> = found.collect();
    let &(most, _) = found.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    found.retain(|(by, _)| (*by - most).norm() > BEYOND_A_CLUSTER * laid.map.spacing);
    let count = found.len() as f64;
    let mean = found.iter().map(|(_, nats)| nats).sum::<f64>() / count;
    let variance = found.iter().map(|(_, nats)| (nats - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (found.len() >= LEAST_PLACES).then(|| (evidence - mean) / variance.sqrt())
}

/// Ways along the longest extent of the map, farther than a cluster is wide.
fn along_the_row(map: &Landscape) -> Option<impl Iterator<Item = Vector3<f64>>> {
    let [axis, ..] = Principal::of(map.points.iter())?.ways();
    let [least, farthest] = [BEYOND_A_CLUSTER, FARTHEST].map(|spacings| spacings * map.spacing);
    let step = move |at: usize| least + (farthest - least) * (at as f64 + 0.5) / STEPS as f64;
    Some((0..STEPS).flat_map(move |at| [axis * step(at), axis * -step(at)]))
}

/// The ways by which a settled pose is moved and has more than so much evidence, with that.
fn kept_moved(
    laid: &Patchwork,
    ways: &[Vector3<f64>],
    most: f64,
    known: impl Fn(&[Option<Landing>]) -> bool + Sync,
) -> Vec<(Vector3<f64>, f64)> {
    let both = ways.iter().zip(moved(laid, ways, NEAR));
    let kept = |(by, moved): (&Vector3<f64>, Option<(f64, f64)>)| {
        // Fewer pairs than a pose has at least are two or three fruits that meet by chance: a third of the evidence of ten.
        let (nats, found) = moved?;
        (nats > most && found > STARS as f64 && !known(&moved_by(laid, by))).then_some((*by, nats))
    };
    both.filter_map(kept).collect()
}

/// Evidence and expected pairs of a pose that is moved, within so many standard deviations, each way; none where less than most of what the
/// map has shown is still expected.
fn moved(laid: &Patchwork, ways: &[Vector3<f64>], gate: f64) -> Vec<Option<(f64, f64)>> {
    let expected = due(laid);
    let of = |there: &mut Patchwork, by: &Vector3<f64>| {
        there.pose.translation = laid.pose.translation + by;
        there.predictions = moved_by(laid, by);
        is_most(due(there) / expected).then(|| evidence_within(gate, there))
    };
    ways.par_iter().map_init(|| laid.clone(), of).collect()
}

/// All predictions, moved.
fn moved_by(laid: &Patchwork, by: &Vector3<f64>) -> Vec<Option<Landing>> {
    laid.predictions.iter().map(|at| at.map(|at| Landing { place: at.place + by, ..at })).collect()
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

    /// What becomes of the query, laid where it was drawn.
    fn drawn<T>([query, map]: [FruitCloud; 2], of: impl Fn(&Patchwork) -> T) -> T {
        let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
        let model = Model { sigma: 0.02, detection: DETECTION, scale: Scale::Metric, vertical: None, row: None };
        let pose = Similarity { translation: query.centre - map.centre, ..Similarity::identity() };
        let mut laid = Patchwork::new(&query, &map, pose, model.sigma, &model);
        laid.cells.iter_mut().for_each(|cell| cell.reached = true);
        let land = |p: &Vector3<f64>| Some(Landing { place: pose.image(p), variance: 0.02 * 0.02 });
        laid.predictions = query.points.iter().map(land).collect();
        of(&laid)
    }

    /// Whether it keeps so much of its evidence when it is moved.
    fn keeps(visits: [FruitCloud; 2], share: f64) -> bool {
        drawn(visits, |laid| {
            let ways = ways(laid, &laid.map.points);
            assert!(!ways.is_empty());
            !kept_moved(laid, &ways, share * evidence_within(NEAR, laid).0, |_| false).is_empty()
        })
    }

    /// By how many standard deviations it has more.
    fn more(visits: [FruitCloud; 2]) -> f64 {
        drawn(visits, |laid| deviations(laid, evidence_within(GATE, laid).0, &laid.map.points)).expect("a row")
    }

    /// Spurs at equal distances on four wires.
    fn spurs(dice: &mut Dice) -> FruitCloud {
        let spur = |i: usize| Vector3::new(0.2 * (i % 30) as f64, 0.0, 0.4 * (i / 30) as f64);
        FruitCloud::from_positions((0..120).map(|i| (spur(i) + 0.02 * dice.normal()).into()).collect())
    }

    #[test]
    fn a_crown_stands_out_of_what_it_has_where_it_is_moved_and_a_lattice_does_not() {
        let mut dice = Dice(5);
        let (crown, lattice) = (more(visits(0.02).into()), more([spurs(&mut dice), spurs(&mut dice)]));
        assert!(crown > 100.0 && lattice < 10.0, "{crown} {lattice}");
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
        assert!(keeps([spurs(&mut dice), spurs(&mut dice)], PATTERN_SHARE));
    }
}
