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
use super::settlement::Settled;
use super::translations::{WIDTH, most_common};
use crate::principal::Principal;
use nalgebra::Vector3;
use rayon::prelude::*;

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

/// What a settled pose has where it is moved.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovedPose {
    pub(super) by: Vector3<f64>,
    /// Nats.
    pub(super) evidence: f64,
}

impl Finding<'_> {
    /// By how many standard deviations a settled finding has more evidence than it has where it is moved.
    ///
    /// There it is wrong for sure, and meets what wrong poses meet on this very planting: on crowns each fruit speaks against it, on long
    /// wires, where neighbours are as near as noise is wide, hundreds of fruits may speak for it a little, and trees of one clone lie on
    /// each other. None where the map shows too few such places.
    pub(super) fn deviations_from_moved(&self) -> Option<f64> {
        let settled = self.settled.as_ref()?;
        deviations(settled.evidence, self.moved(settled), self.growth.patches.map.spacing)
    }

    /// Where a settled finding has most evidence when it is moved, so many places farther apart than a cluster is wide.
    pub(super) fn most_moved(&self, count: usize) -> Vec<MovedPose> {
        let mut moved = self.settled.as_ref().map_or(Vec::new(), |settled| self.moved(settled).to_vec());
        moved.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        let apart = BEYOND_A_CLUSTER * self.growth.patches.map.spacing;
        first_of_each(moved.into_iter(), count, |one, other| (one.by - other.by).norm() < apart)
    }

    /// What it has where it is moved by what lays its pairs on other fruits of the map, and along the row.
    fn moved<'a>(&self, settled: &'a Settled) -> &'a [MovedPose] {
        settled.moved.get_or_init(|| {
            let map = self.growth.patches.map;
            let Overlap { pose, sigma, predictions, .. } = settled.overlap.clone();
            let direction = settled.direction.clone();
            let laid = Patchwork { pose, sigma, direction, predictions, ..self.growth.patches.clone() };
            let believed = settled.beliefs.links().filter(|(_, probability)| *probability > 0.5);
            let pairs: Vec<_> = believed.map(|(edge, _)| map.points[edge.map as usize]).collect();
            everywhere(&laid, &pairs)
        })
    }
}

/// What a pose has where it is moved, with pairs at these places of the map.
fn everywhere(laid: &Patchwork, pairs: &[Vector3<f64>]) -> Vec<MovedPose> {
    let mut ways = ways(laid, pairs);
    ways.extend(along_the_row(&of_the_row(laid), laid.map.spacing, FARTHEST));
    let expected = due(laid);
    let of = |there: &mut Patchwork, by: &Vector3<f64>| {
        there.pose.translation = laid.pose.translation + by;
        there.predictions = moved_by(&laid.predictions, by);
        // Where less than most of what the map has shown is still expected, it shows nothing.
        is_most(due(there) / expected).then(|| MovedPose { by: *by, evidence: evidence_within(NEAR, there) })
    };
    let all: Vec<Option<MovedPose>> = ways.par_iter().map_init(|| laid.clone(), of).collect();
    all.into_iter().flatten().collect()
}

/// Ways to move an overlap that lay its pairs on other fruits of the map, farther than a cluster is wide.
fn ways(laid: &Patchwork, pairs: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let map = laid.map;
    let [least, farthest] = [BEYOND_A_CLUSTER, FARTHEST].map(|spacings| spacings * map.spacing);
    let asked = pairs.iter().copied().step_by(pairs.len().div_ceil(PAIRS_ASKED).max(1));
    most_common(asked, map, farthest, WIDTH * laid.sigma).filter(|by| by.norm() > least).take(TRIED).collect()
}

/// The fruits that say which way the row goes: those of the query as they are laid, where half of them is as long as the way that they are moved,
/// for a block may be wider than its rows are long; else the map's.
fn of_the_row(laid: &Patchwork) -> Vec<Vector3<f64>> {
    let landings: Vec<_> = laid.predictions.iter().flatten().map(|at| at.place).collect();
    let is_long = |row: Principal| 2.0 * row.extents[0] > FARTHEST * laid.map.spacing;
    if Principal::of(landings.iter()).is_some_and(is_long) { landings } else { laid.map.points.clone() }
}

/// Ways along the longest extent of a cloud, farther than a cluster is wide and as far as so many spacings.
pub(super) fn along_the_row(points: &[Vector3<f64>], spacing: f64, farthest: f64) -> Vec<Vector3<f64>> {
    let Some(principal) = Principal::of(points.iter()) else { return Vec::new() };
    let [axis, ..] = principal.ways();
    let [least, farthest] = [BEYOND_A_CLUSTER, farthest].map(|spacings| spacings * spacing);
    let step = |at: usize| least + (farthest - least) * (at as f64 + 0.5) / STEPS as f64;
    (0..STEPS).flat_map(|at| [axis * step(at), axis * -step(at)]).collect()
}

fn most(moved: &[MovedPose]) -> Option<&MovedPose> {
    moved.iter().max_by(|a, b| a.evidence.total_cmp(&b.evidence))
}

/// By how many standard deviations `evidence` is more than that of the pose moved.
///
/// The one place with most of it is left out, for that may be a second tree that looks the same: a rival, and no pattern.
fn deviations(evidence: f64, moved: &[MovedPose], spacing: f64) -> Option<f64> {
    let most = most(moved)?.by;
    let elsewhere = |moved: &&MovedPose| (moved.by - most).norm() > BEYOND_A_CLUSTER * spacing;
    let found: Vec<f64> = moved.iter().filter(elsewhere).map(|moved| moved.evidence).collect();
    let count = found.len() as f64;
    let mean = found.iter().sum::<f64>() / count;
    let variance = found.iter().map(|nats| (nats - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (found.len() >= LEAST_PLACES).then(|| (evidence - mean) / variance.sqrt())
}

/// All predictions, moved.
fn moved_by(predictions: &[Option<Landing>], by: &Vector3<f64>) -> Vec<Option<Landing>> {
    predictions.iter().map(|at| at.map(|at| Landing { place: at.place + by, ..at })).collect()
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
    use crate::verified::doubts::RIVAL;
    use crate::verified::fixture::{Dice, visits};
    use crate::verified::hypothesis::{DETECTION, Model};
    use crate::verified::landscape::Landscape;

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

    /// By how many standard deviations what is drawn has more than it has where it is moved.
    fn more(visits: [FruitCloud; 2]) -> f64 {
        let of = |laid: &Patchwork| {
            deviations(evidence_within(NEAR, laid), &everywhere(laid, &laid.map.points), laid.map.spacing)
        };
        drawn(visits, of).expect("a row")
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

    /// The most that what is drawn keeps of its evidence where it is moved.
    fn keeps(visits: [FruitCloud; 2]) -> f64 {
        let of = |laid: &Patchwork| {
            let moved = everywhere(laid, &laid.map.points);
            most(&moved).expect("a place").evidence / evidence_within(NEAR, laid)
        };
        drawn(visits, of)
    }

    #[test]
    fn fruits_at_equal_distances_keep_enough_where_they_are_moved_for_a_rival_and_a_crown_does_not() {
        let mut dice = Dice(5);
        assert!(keeps([spurs(&mut dice), spurs(&mut dice)]) > RIVAL && keeps(visits(0.02).into()) < 0.05);
    }

    #[test]
    fn three_fruits_of_a_dozen_that_meet_where_they_are_moved_are_no_rival() {
        let mut dice = Dice(3);
        let mut fruits: Vec<Vector3<f64>> =
            (0..9).map(|_| Vector3::new(1.5 * dice.uniform(), 0.0, 1.2 * dice.uniform())).collect();
        let copied: Vec<_> = fruits[..3].iter().map(|p| p + 0.9 * Vector3::x()).collect();
        fruits.extend(copied);
        let visit = || FruitCloud::from_positions(fruits.iter().map(|&p| p.into()).collect());
        assert!(keeps([visit(), visit()]) < RIVAL);
    }
}
