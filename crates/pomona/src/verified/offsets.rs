//! Poses of rows laid along rows, from the offsets between all their fruits.
//!
//! Visits to opposite sides of a row have the fruits in the middle of the canopy in common, one in seven or fewer: of four
//! neighbours hardly ever all, and no seed survives. But rows lie along rows. Their principal axes give the turn up to
//! half-turns and some degrees, and under the right turn every fruit in common has the same offset from its partner. So the
//! offsets between all fruits are counted ([`super::votes`]). What stands out is pulled into place by all fruits at once
//! ([`super::soft`]) and refined, under the noise that suits the pull best and the share that is seen again where ordinary
//! shares have found nothing. Most of it is wrong, and shows what the right pose must stand out of.
//!
//! Noise as large as the gaps inside a cluster leaves no constellation either, but the same trees still lie on themselves.

use super::axes::row_axes;
use super::contender::first_of_each;
use super::hypothesis::{Hypothesis, Model, refined};
use super::landscape::Landscape;
use super::soft;
use super::votes::Rows;
use crate::geometry::Similarity;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Share of fruits seen again, where ordinary shares have found nothing.
pub(super) const FEW_AGAIN: f64 = 0.25;

/// How many poses are looked at and then go on, and the widths, in spacings, at which fruits pull them into place:
/// from half a cell down to what rows bend. Of 24 some 13 lie apart, which [`super::outlier`] asks for.
const PULLS: [(usize, &[f64]); 2] = [(256, &[0.25, 0.25]), (24, &[0.2, 0.2, 0.16, 0.16])];

/// Two poses within so many spacings, and turned by less than so many radians, are one.
const SAME: (f64, f64) = (0.5, 0.06);

/// What is assumed of rows that may have been seen from opposite sides, where ordinary shares have found nothing.
pub(super) fn few_again(map: &Landscape, model: &Model) -> Model {
    Model { detection: FEW_AGAIN, row: row_axes(map), ..*model }
}

/// Poses by what the fruits under them say, most evidence first, under the assumptions of [`few_again`].
pub(super) fn hypotheses(query: &Landscape, map: &Landscape, model: &Model) -> Vec<Hypothesis> {
    let Some(rows) = Rows::new(query, map, model.scale) else { return Vec::new() };
    let mut peaks = rows.peaks(model);
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut poses: Vec<Similarity> = peaks.into_iter().map(|(_, pose)| pose).collect();
    for (most, widths) in PULLS {
        let some = distinct(poses, most, map.spacing);
        let mut found: Vec<_> = some.par_iter().map(|pose| soft::pulled(query, map, model, pose, widths)).collect();
        found.sort_by(|(_, a), (_, b)| b.total_cmp(a));
        poses = found.into_iter().map(|(pose, _)| pose).collect();
    }
    let reach = query.points.iter().fold(0.0f64, |far, p| far.max(p.norm()));
    let apart = distinct(poses, usize::MAX, map.spacing);
    // Visits have one noise: under one of its own every pose would look its best, and few would show what chance reaches.
    let sigma = soft::sharpest(query, map, model, &apart);
    let widths = [sigma / map.spacing; 3];
    let pulled = |pose: &Similarity| (soft::pulled(query, map, model, pose, &widths).0, Vector3::zeros());
    let starts: Vec<_> = apart.par_iter().map(pulled).collect();
    refined([query, map], &Model { sigma, ..*model }, reach, &starts)
}

/// The first poses, one of those that are the same.
fn distinct(poses: Vec<Similarity>, most: usize, spacing: f64) -> Vec<Similarity> {
    let (spacings, turn_rad) = SAME;
    let same = |one: &Similarity, other: &Similarity| {
        (one.translation - other.translation).norm() < spacings * spacing && one.turn_to(other) < turn_rad
    };
    first_of_each(poses.into_iter(), most, same)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::geometry::Scale;
    use crate::verified::fixture::Dice;
    use crate::verified::vertical::Vertical;
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
        let turn = Rotation3::new(Vector3::new(0.7, -1.9, 0.4)).inverse();
        for (scale, times) in [(Scale::Metric, 1.0), (Scale::Free, 1.7)] {
            let [mut query, map] = sides();
            query.positions.iter_mut().for_each(|p| *p *= times);
            let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
            let model = Model { sigma: 0.02, detection: 0.55, scale, vertical: None, row: None };
            let found = hypotheses(&query, &map, &few_again(&map, &model));
            let best = found.first().expect("something stands out").pose;
            for p in &query.points {
                let place = turn * ((p + query.centre) / times - Vector3::new(3.0, -1.0, 2.0)) - map.centre;
                assert!((best.image(p) - place).norm() < 0.1);
            }
            // What is up in the query is in depth in the map: no row laid along a row does that.
            let lying = Model { vertical: Some(Vertical::new([turn.inverse() * Vector3::y(), Vector3::z()])), ..model };
            assert!(hypotheses(&query, &map, &few_again(&map, &lying)).is_empty());
        }
    }
}
