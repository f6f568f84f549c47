//! Answers that rest on stems, each of which lies better elsewhere.
//!
//! Bunches of bananas, rings of palms: what hangs on one stem hangs on the next one likewise, turned and a little higher. Two rows
//! have pairs of such stems that stand to each other alike by chance, and then a dozen fruits meet partners, though no more came
//! together than the places of two stems. Of a true answer each stem has its own fruits, and more evidence than on any other; of
//! these the stems are found elsewhere with more, one by one.

use super::acceptance::SURE;
use super::case::{Finding, Findings, Log, Search};
use super::contender::{Contender, REFINED, by_evidence, distinct};
use super::hypothesis::refined;
use super::landscape::Landscape;
use super::proposal::Effort;
use super::search::REACH;
use super::seeds::STARS;
use crate::cloud::FruitCloud;
use crate::geometry::Similarity;
use crate::moments::Moments;
use crate::neighbours::tree::single;
use crate::statistics::median;
use nalgebra::{Point3, Vector3};

/// Times the median distance from a fruit to the fourth next that a gap between two stems is wider than.
const GAP: f64 = 3.0;

/// Pairs of a stem that fix a pose; and fruits that no stem has, but a crown.
const LEAST_PAIRS: usize = 4;
const MOST_FRUITS: usize = 32;

/// Spacings that a stem lies off, on average over its fruits, where it lies elsewhere.
const OFF: f64 = 0.5;

/// Fruits of the query that hang together, about their middle, and where the answer lays them.
struct Stem {
    fruits: Landscape,
    laid: Similarity,
}

impl Search<'_> {
    /// Whether the stems of an answer have so much more evidence elsewhere, all together, that it is improbable as a false alarm is.
    ///
    /// Rows that are laid along rows are not asked: they have too few fruits in common for any part of them to be found.
    pub(super) fn stems_lie_elsewhere(&self, found: &Finding, log: &Log) -> bool {
        let is_sure = found.overlap.log_odds >= SURE * log.threshold;
        if is_sure || found.growth.patches.model.row.is_some() {
            return false;
        }
        self.stems(found).iter().map(|stem| self.more_here(stem)).sum::<f64>() < self.config.false_alarm_rate.ln()
    }

    /// The stems of the query that have enough pairs to be found by themselves; none where one has more fruits than stems have.
    fn stems(&self, found: &Finding) -> Vec<Stem> {
        let mut paired = vec![false; self.query.len()];
        // Further parts of a row that is torn apart are laid by poses of their own.
        let links = found.settled.iter().flat_map(|settled| settled.beliefs.links());
        links.filter(|(_, probability)| *probability > 0.5).for_each(|(edge, _)| paired[edge.query as usize] = true);
        let pairs = |stem: &[u32]| stem.iter().filter(|&&row| paired[row as usize]).count();
        let all: Vec<_> = together(self.query).into_iter().filter(|stem| pairs(stem) >= LEAST_PAIRS).collect();
        // Where most of the query hangs together, the search was for that.
        let most = MOST_FRUITS.min(self.query.len() / 2);
        if all.iter().any(|stem| stem.len() > most) {
            return Vec::new();
        }
        all.iter().map(|stem| self.stem(found, stem)).collect()
    }

    fn stem(&self, found: &Finding, rows: &[u32]) -> Stem {
        let overlap = found.as_it_stands();
        let cloud = rows.iter().map(|&row| Point3::from(self.query.points[row as usize])).collect();
        let fruits = Landscape::with_spacing(&FruitCloud::from_positions(cloud), Some(self.query.spacing));
        let mut moments = Moments::default();
        for (&at, p) in fruits.rows.iter().zip(&fruits.points) {
            if let Some(landing) = overlap.predictions[rows[at as usize] as usize] {
                moments.add(p, &landing.place, 1.0);
            }
        }
        let start = Similarity { translation: overlap.pose.image(&fruits.centre), ..overlap.pose };
        let laid = moments.step(&start, self.model.scale, 0.0).unwrap_or(start);
        Stem { fruits, laid }
    }

    /// By how much more evidence a stem has where it is laid than wherever else it is found, nats.
    fn more_here(&self, stem: &Stem) -> f64 {
        let Stem { fruits, laid } = stem;
        let search = self.for_query(fruits);
        let most = |starts: &[(Similarity, Vector3<f64>)], is_asked: &dyn Fn(&Similarity) -> bool| {
            let found = refined([fruits, self.map], &self.model, REACH * fruits.spacing, starts);
            found.into_iter().find(|one| is_asked(&one.pose)).map_or(0.0, |one| one.log_odds.max(0.0))
        };
        let off = |pose: &Similarity| {
            let all: f64 = fruits.points.iter().map(|p| (pose.image(p) - laid.image(p)).norm()).sum();
            all > OFF * self.map.spacing * fruits.len() as f64
        };
        let mut log = Findings::none(Effort::default(), 0.0).log;
        let mut elsewhere: Vec<Contender> =
            search.rounds().flat_map(|seeds| search.ask(&seeds, &mut log).concat()).collect();
        elsewhere.retain(|one| off(&one.pose));
        elsewhere.sort_unstable_by(by_evidence);
        let best = distinct(fruits, self.map.spacing, &elsewhere, REFINED);
        let starts: Vec<_> = best.iter().map(|one| (one.pose, Vector3::zeros())).collect();
        most(&[(*laid, Vector3::zeros())], &|_| true) - most(&starts, &off)
    }
}

/// Fruits that ways without a gap lead to from each other, in the order of the first ones.
fn together(cloud: &Landscape) -> Vec<Vec<u32>> {
    let places: Vec<_> = cloud.points.iter().map(single).collect();
    let mut nearest = Vec::new();
    let mut widths: Vec<f64> = places
        .iter()
        .filter_map(|place| {
            cloud.tree.nearest(place, 1 + STARS, &mut nearest);
            nearest.get(STARS).map(|(_, d2)| f64::from(*d2).sqrt())
        })
        .collect();
    let gap = (GAP * median(&mut widths)) as f32;
    let (mut is_taken, mut all) = (vec![false; places.len()], Vec::new());
    for first in 0..places.len() as u32 {
        if std::mem::replace(&mut is_taken[first as usize], true) {
            continue;
        }
        let (mut those, mut next) = (vec![first], 0);
        while let Some(&at) = those.get(next) {
            cloud.tree.within(&places[at as usize], gap, |other, _| {
                if !std::mem::replace(&mut is_taken[other as usize], true) {
                    those.push(other);
                }
            });
            next += 1;
        }
        all.push(those);
    }
    all
}
