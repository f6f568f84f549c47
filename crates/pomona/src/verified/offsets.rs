//! Poses of rows laid along rows, from the offsets between all their fruits.
//!
//! Visits to opposite sides of a row have the fruits in the middle of the canopy in common, one in seven or fewer: of four
//! neighbours hardly ever all, and no seed survives. But rows lie along rows. Their principal axes give the turn up to
//! half-turns and some degrees, and under the right turn every fruit in common has the same offset from its partner. So the
//! offsets between all fruits are counted ([`super::votes`]). What stands out is refined on all fruits at once, under the share that
//! is seen again where ordinary shares have found nothing. Most of it is wrong, and shows what the right pose must stand out of.

use super::contender::first_of_each;
use super::hypothesis::{Hypothesis, Model, STEPS, refined};
use super::landscape::Landscape;
use super::outlier::COMPARED;
use super::placement::Placement;
use super::votes::{Rows, STEP_RAD};
use crate::geometry::Scale;
use nalgebra::Vector3;

/// Share of fruits seen again, where ordinary shares have found nothing.
pub(super) const FEW_AGAIN: f64 = 0.25;

/// Poses that are refined at the width of a cell, and how many of them at that of the noise: of 24 some 13 lie apart, which
/// [`super::outlier`] asks for.
const LOOKED_AT: usize = 256;
const REFINED: usize = 24;

/// Steps at the width of a cell: one fit, and one look at what it gives. Six find no more.
const LOOKS: usize = 2;

/// Two poses within so many spacings, and turned by less than so many radians, are one.
const SAME: f64 = 0.5;
const SAME_TURN_RAD: f64 = 0.06;

/// Noise of a peak, in that of a pair: its cell is wider than the noise.
const WIDE: f64 = 2.5;

/// Times that tilted starts are tried.
const TILTINGS: usize = 3;

/// Poses by what the fruits under them say, most evidence first.
pub(super) fn hypotheses(
    query: &Landscape,
    map: &Landscape,
    model: &Model,
    admits: &(impl Fn(&Placement) -> bool + Sync),
) -> Vec<Hypothesis> {
    let model = Model { detection: FEW_AGAIN, ..*model };
    if model.scale == Scale::Free {
        return Vec::new();
    }
    let Some(rows) = Rows::new(query, map) else { return Vec::new() };
    let wide = Model { sigma: WIDE * model.sigma, ..model };
    let reach = query.points.iter().fold(0.0f64, |far, p| far.max(p.norm()));
    let refined = |poses: &[Placement], model: &Model, steps: usize| {
        let starts: Vec<_> = poses.iter().map(|&pose| (pose, Vector3::zeros())).collect();
        refined([query, map], model, steps, reach, &starts)
    };
    let mut peaks = rows.peaks(admits);
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let looks = refined(&distinct(peaks.iter().map(|peak| peak.1), LOOKED_AT, map.spacing), &wide, LOOKS);
    let best = distinct(looks.iter().map(|look| look.pose), REFINED, map.spacing);
    let mut found = refined(&best, &model, STEPS);
    // Half a step between turns, at the ends of a row, is as far as fruits hang from each other.
    for seed in found.iter_mut().take(COMPARED) {
        for _ in 0..TILTINGS {
            let tilted = seed.pose.turned_either_way(&Vector3::zeros(), STEP_RAD);
            match refined(&tilted, &model, STEPS).first() {
                Some(better) if better.log_odds > seed.log_odds => *seed = *better,
                _ => break,
            }
        }
    }
    found.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
    found
}

/// The first poses, one of those that are the same.
fn distinct(poses: impl Iterator<Item = Placement>, most: usize, spacing: f64) -> Vec<Placement> {
    let same = |one: &Placement, other: &Placement| {
        (one.translation - other.translation).norm() < SAME * spacing && one.turn_to(other) < SAME_TURN_RAD
    };
    first_of_each(poses, most, same)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::verified::fixture::Dice;
    use nalgebra::{Point3, Rotation3};

    /// A row of 6 x 2.6 x 0.6 m; a visit to either side of it sees a fruit the surer the nearer it hangs, four in ten of
    /// those of one visit in both.
    fn sides() -> [FruitCloud; 2] {
        let mut dice = Dice(3);
        let mut seen = [Vec::new(), Vec::new()];
        for _ in 0..500 {
            let fruit = Vector3::new(6.0 * dice.uniform(), 2.6 * dice.uniform(), 0.6 * dice.uniform() - 0.3);
            for (visit, side) in seen.iter_mut().zip([-1.0, 1.0]) {
                if dice.uniform() < 1.0 / (1.0 + (-side * fruit.z / 0.2).exp()) {
                    visit.push(fruit + dice.normal() * 0.02);
                }
            }
        }
        let turn = Rotation3::new(Vector3::new(0.7, -1.9, 0.4));
        let moved = |p: &Vector3<f64>| Point3::from(turn * p + Vector3::new(3.0, -1.0, 2.0));
        let [query, map] = seen;
        [query.iter().map(moved).collect(), map.into_iter().map(Point3::from).collect()].map(FruitCloud::from_positions)
    }

    #[test]
    fn opposite_sides_are_laid_on_each_other_by_what_the_middle_shows() {
        let [query, map] = sides().map(|cloud| Landscape::new(&cloud));
        let model = Model { sigma: 0.02, detection: 0.55, scale: Scale::Metric, vertical: None };
        let found = hypotheses(&query, &map, &model, &|_| true);
        let turn = Rotation3::new(Vector3::new(0.7, -1.9, 0.4)).inverse();
        let best = found.first().expect("something stands out").pose;
        for p in &query.points {
            let place = turn * (p + query.centre - Vector3::new(3.0, -1.0, 2.0)) - map.centre;
            assert!((best.apply(p) - place).norm() < 0.1);
        }
        let free = Model { scale: Scale::Free, ..model };
        assert!(hypotheses(&query, &map, &free, &|_| true).is_empty());
        assert!(hypotheses(&query, &map, &model, &|_| false).is_empty());
    }
}
