//! Which fruits of the query hang on a tree that was replaced.
//!
//! Around a fruit whose tree stands the map has that fruit, or has it not, and the others that keep their distance from it; around one
//! whose tree was replaced it has what hung on the old one. Fruits on thin wires meet those so often that a share of pairs says little, and
//! where they keep their distance from each other, chance is more even than Poisson's. So the nearest alone is asked about, and what
//! another tree puts there the map itself shows, moved along its row.

use super::landscape::Landscape;
use super::pairing::Meeting;
use super::patches::{Landing, Patchwork};
use crate::neighbours::others::each_row;

/// Standard deviations within which the nearest fruit is looked for, and within which it is close.
const REACH: f64 = 5.0;
const CLOSE: f64 = 2.0;

/// Support under which the map says nothing.
const LEAST_SUPPORT: f64 = 0.1;

/// What the nearest fruit says of one that is not in the map lies between this and its inverse: a map's own fruits are too few to say more.
const LEAST_RATIO: f64 = 0.05;

/// Of pairs, those beyond the reach: the share that moved otherwise than their neighbours.
const BEYOND: f64 = 0.01;

/// Most of the places that have a close fruit by chance: not all have one where they are [`MOST_OFTEN`] times as many.
const MOST_BY_CHANCE: f64 = 0.3;

/// How many times as often as the map moved along its row another tree may put a fruit close, and how many such meetings the belief that it
/// does so as often is worth.
const MOST_OFTEN: f64 = 3.0;
const MEETINGS: f64 = 5.0;

/// Share of trees that are replaced beforehand, and the fruits that this is worth; and the same of the share seen again.
const BELIEVED_REPLACED: (f64, f64) = (0.02, 20.0);
const BELIEVED_SEEN: (f64, f64) = (0.7, 2.0);

/// Shares of trees that were replaced.
const SHARES: (f64, f64) = (0.002, 0.9);

/// Where the search for it begins, its steps at the most, and the step that ends it.
const START: f64 = 0.2;
const STEPS: usize = 20;
const STILL: f64 = 1e-3;

/// Likelihoods of what the map has nearest to a fruit of the query, over that of another tree as the map moved along its row shows it.
#[derive(Debug, Clone, Copy)]
struct Nearest {
    /// Of a tree that stands, where the map has not this fruit, and where it has.
    alone: f64,
    pair: f64,
    is_close: bool,
    /// Probability that another tree puts a fruit so close.
    by_chance: f64,
}

impl Nearest {
    /// That the tree stands, where so many of its fruits are seen again.
    fn stands(&self, seen: f64) -> f64 {
        (1.0 - seen) * self.alone + seen * self.pair
    }

    /// That it was replaced, where fruits are so many times as often close as by chance.
    fn replaced(&self, often: f64) -> f64 {
        if self.is_close { often } else { (1.0 - often * self.by_chance) / (1.0 - self.by_chance) }
    }
}

/// Trees that stand or were replaced.
#[derive(Debug, Clone, Copy)]
struct Trees {
    /// Share of the fruits of trees that stand which are seen again.
    seen: f64,
    /// How many times as often as by chance those of other trees are close.
    often: f64,
    /// Share of the trees that were replaced.
    replaced: f64,
}

impl Patchwork<'_> {
    /// Probability that each fruit of the query hangs on another tree than the map has there, as the fruits around it tell.
    pub(super) fn other_trees(&self, meetings: &[Meeting]) -> Vec<f64> {
        let nearest = self.nearest(meetings);
        let (mut trees, mut others) = (Trees { seen: BELIEVED_SEEN.0, often: 1.0, replaced: START }, Vec::new());
        for _ in 0..STEPS {
            others = trees.others(self.query, &nearest);
            let before = trees.replaced;
            trees = trees.seen_by(&nearest, &others);
            if (trees.replaced - before).abs() < STILL {
                break;
            }
        }
        let all_stand = trees.seen_where_all_stand(&nearest);
        // Each fruit is foretold by those around it, its own left out: so nothing but what is there can gain.
        let gain: f64 = nearest
            .iter()
            .zip(&others)
            .filter_map(|(one, other)| {
                let one = one.as_ref()?;
                let both = (1.0 - other) * one.stands(trees.seen) + other * one.replaced(trees.often);
                Some((both / one.stands(all_stand)).ln())
            })
            .sum();
        let believed = 1.0 / (1.0 + (-gain).exp());
        others.iter().map(|other| other * believed).collect()
    }

    /// What the map has nearest to each fruit, where it would have shown one.
    fn nearest(&self, meetings: &[Meeting]) -> Vec<Option<Nearest>> {
        let mut met: Vec<Option<&Meeting>> = vec![None; self.query.len()];
        for meeting in meetings {
            let nearest = &mut met[meeting.query as usize];
            if nearest.is_none_or(|nearest| meeting.distance < nearest.distance) {
                *nearest = Some(meeting);
            }
        }
        let map = self.map;
        let own = map.nearest_companions();
        let elsewhere = &map.moved().nearest;
        each_row(self.query.len(), |row| {
            let Landing { place, variance } = self.predictions[row]?;
            let support = self.shown(row, &place);
            let [reach, close] = [REACH, CLOSE].map(|deviations| deviations * variance.sqrt());
            let within = |distance: f64| [own, elsewhere].map(|all| support * all.between(0.0, distance));
            let nearest = met[row].filter(|meeting| meeting.distance < reach);
            let (alone, pair) = if let Some(meeting) = nearest {
                let [alike, other] = [own, elsewhere].map(|all| all.density(meeting.distance).max(map.floor * support));
                let alone = (alike / other).max(LEAST_RATIO);
                (alone, meeting.density * (1.0 - own.between(0.0, meeting.distance)) / other)
            } else {
                let [alike, other] = within(reach).map(|share| (1.0 - share).max(LEAST_RATIO));
                (alike / other, BEYOND)
            };
            (support > LEAST_SUPPORT).then(|| Nearest {
                alone,
                pair: support * pair + (1.0 - support) * alone,
                is_close: nearest.is_some_and(|meeting| meeting.distance < close),
                by_chance: within(close)[1].min(MOST_BY_CHANCE),
            })
        })
    }
}

impl Trees {
    /// Probability that each fruit hangs on another tree, by the fruits around it but not by itself.
    ///
    /// Those that are listed are taken to be of one tree, and the near ones to say most of it.
    fn others(&self, cloud: &Landscape, nearest: &[Option<Nearest>]) -> Vec<f64> {
        let ratio = |one: &Nearest| (one.stands(self.seen) / one.replaced(self.often)).ln();
        let ratios: Vec<f64> = nearest.iter().map(|one| one.as_ref().map_or(0.0, ratio)).collect();
        let beforehand = ((1.0 - self.replaced) / self.replaced).ln();
        let other = |row: usize| {
            let around = cloud.kin(row).fold((0.0, 0.0, 0.0), |(sum, weights, count), (other, weight)| {
                (sum + weight * ratios[other as usize], weights + weight, count + 1.0)
            });
            let (sum, weights, count) = around;
            1.0 / (1.0 + (beforehand + sum * count / f64::max(weights, 1.0)).exp())
        };
        each_row(cloud.len(), other)
    }

    /// What the fruits show, each on another tree with the probability `others`: a step of expectation and maximisation.
    fn seen_by(&self, nearest: &[Option<Nearest>], others: &[f64]) -> Self {
        let [mut again, mut standing, mut met, mut expected, mut gone] = [0.0; 5];
        for (one, other) in nearest.iter().zip(others).filter_map(|(one, other)| Some((one.as_ref()?, other))) {
            again += (1.0 - other) * self.seen * one.pair / one.stands(self.seen);
            standing += 1.0 - other;
            met += other * f64::from(u8::from(one.is_close));
            expected += other * one.by_chance;
            gone += other;
        }
        let believed = |found: f64, of: f64, (share, worth): (f64, f64)| (found + share * worth) / (of + worth);
        Self {
            seen: believed(again, standing, BELIEVED_SEEN),
            often: believed(met, expected, (1.0, MEETINGS)).clamp(1.0, MOST_OFTEN),
            replaced: believed(gone, gone + standing, BELIEVED_REPLACED).clamp(SHARES.0, SHARES.1),
        }
    }

    /// Share seen again where all trees stand.
    fn seen_where_all_stand(&self, nearest: &[Option<Nearest>]) -> f64 {
        let none_other = vec![0.0; nearest.len()];
        let mut trees = *self;
        for _ in 0..STEPS {
            let before = trees.seen;
            trees = trees.seen_by(nearest, &none_other);
            if (trees.seen - before).abs() < STILL {
                break;
            }
        }
        trees.seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Scale, Similarity};
    use crate::verified::fixture::visits;
    use crate::verified::hypothesis::{DETECTION, Model};
    use crate::verified::pairing::GATE;
    use nalgebra::Vector3;

    /// Means of the fruits before the middle of a row and behind it, which lie elsewhere by so much.
    fn others(by: Vector3<f64>) -> [f64; 2] {
        let (query, map) = visits(0.02);
        let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
        let model = Model { sigma: 0.02, detection: DETECTION, scale: Scale::Metric, vertical: None, row: None };
        let pose = Similarity { translation: query.centre - map.centre, ..Similarity::identity() };
        let mut laid = Patchwork::new(&query, &map, pose, model.sigma, &model);
        laid.cells.iter_mut().for_each(|cell| cell.reached = true);
        let land = |p: &Vector3<f64>| {
            let place = pose.image(p) + if p.x > 0.0 { by } else { Vector3::zeros() };
            Some(Landing { place, variance: 0.02 * 0.02 })
        };
        laid.predictions = query.points.iter().map(land).collect();
        let others = laid.other_trees(&laid.meetings(GATE, |meeting| Some(*meeting)));
        [false, true].map(|behind| {
            let those = (0..query.len()).filter(|&row| {
                let x = query.points[row].x;
                (0.6..1.4).contains(&x.abs()) && (x > 0.0) == behind
            });
            let (sum, count) = those.fold((0.0, 0.0), |(sum, count), row| (sum + others[row], count + 1.0));
            sum / count
        })
    }

    #[test]
    fn fruits_of_a_half_that_was_replaced_hang_on_other_trees_and_where_all_stand_none_does() {
        let [before, behind] = others(Vector3::new(-0.37, 0.21, 0.13));
        assert!(before < 0.05 && behind > 0.9, "{before} {behind}");
        let stand = others(Vector3::zeros());
        assert!(stand.iter().all(|&other| other < 0.02), "{stand:?}");
    }
}
