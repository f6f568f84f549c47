//! From seeds to hypotheses: rounds of query seeds, their candidates in the map, the best of them refined.

use super::case::{Log, Search, VerifiedMap};
use super::contender::{Contender, REFINED, by_evidence, distinct};
use super::hypothesis::{Hypothesis, refined};
use super::landscape::Landscape;
use super::proposal::{Effort, Proposer};
use super::seeds::{COMPANIONS, SHORTEST, Seed, WITHIN, canonical, longest, near_ties, without_scale};
use crate::geometry::Scale;
use crate::random::shuffled;
use rayon::prelude::*;

/// Fruits whose seeds make the first round, at the most, and no less than half of them where there are as many: where the visits
/// overlap well, few are enough in a cloud of any size.
pub(super) const FIRST_FRUITS: usize = 256;

/// Small clouds try at least this many seeds: all of them in a cloud of twelve.
const FEW_SEEDS: u64 = 1500;

/// Times more seeds where the vertical is known, which rules most candidates out before they cost much.
const UPRIGHT_SEEDS: u64 = 2;

/// Seeds that one thread asks without a look at what is left: some have a thousand times the candidates of others.
const MOST_AT_ONCE: usize = 16;

/// The `turn`-th seed of a fruit: its three companions in a fixed shuffled order without repeats.
fn seed_of(query: &Landscape, row: u32, turn: u64) -> Option<Seed> {
    let near = query.neighbours(row as usize);
    let n = near.len().min(COMPANIONS) as u64;
    let count = n * n.saturating_sub(1) * n.saturating_sub(2) / 6;
    if turn >= count {
        return None;
    }
    let key = shuffled(u64::from(row));
    // A stride that shares no factor with the count walks through all of them.
    let stride = [37, 31, 29, 23, 19, 17, 13, 11, 7, 1].into_iter().find(|s| !count.is_multiple_of(*s)).unwrap_or(1);
    let mut triples = (0..n).flat_map(|c| (0..c).flat_map(move |b| (0..b).map(move |a| [a, b, c])));
    let [a, b, c] = triples.nth(((key % count + turn * stride) % count) as usize)?.map(|i| near[i as usize]);
    canonical(&query.points, [row, a, b, c])
}

impl Search<'_> {
    /// The rounds of a search, each made when it is asked for: seeds of some fruits, another of every fruit, then the longest of all.
    pub(super) fn rounds(&self) -> impl Iterator<Item = Vec<Seed>> {
        let some = |round: usize| match round {
            0 => of_some_fruits(self.query, self.query.len().div_ceil(FIRST_FRUITS) as u64, 0..1),
            1 => of_some_fruits(self.query, 1, 1..2),
            _ => self.longest_seeds(),
        };
        (0..3).map(some)
    }

    /// The longest seeds of the query that the map can have: what is longer than nearly all of its own, as where fruits were picked
    /// before the query, has others between its fruits there.
    fn longest_seeds(&self) -> Vec<Seed> {
        let each = self.config.seeds_per_fruit.saturating_mul(self.model.vertical.map_or(1, |_| UPRIGHT_SEEDS));
        let count = each.saturating_mul(self.query.len() as u64).max(FEW_SEEDS);
        longest(self.query, usize::try_from(count).unwrap_or(usize::MAX), self.prepared.seeds.longest)
    }

    /// Candidates of all seeds, most evidence first: the best of them, one of each pose, and the others.
    pub(super) fn ask(&self, seeds: &[Seed], log: &mut Log) -> [Vec<Contender>; 2] {
        let of_each: Vec<(Vec<Contender>, Effort)> =
            seeds.par_iter().with_max_len(MOST_AT_ONCE).map(|&seed| self.candidates_of(seed)).collect();
        log.seeds += seeds.len();
        log.effort = log.effort + of_each.iter().fold(Effort::default(), |sum, (_, effort)| sum + *effort);
        log.threshold = self.threshold(log.effort.stands.share_left());
        let mut candidates: Vec<Contender> = of_each.into_iter().flat_map(|(found, _)| found).collect();
        candidates.sort_unstable_by(by_evidence);
        let best = distinct(self.query, self.map.spacing, &candidates, REFINED);
        candidates.retain(|one| best.iter().all(|other| other.key != one.key));
        [best, candidates]
    }

    /// Candidates of one seed of the query that survive the fit and the first look.
    fn candidates_of(&self, seed: Seed) -> (Vec<Contender>, Effort) {
        let Self { query, map, prepared: VerifiedMap { seeds: index, .. }, model, .. } = *self;
        let (mut found, mut effort) = (Vec::new(), Effort::default());
        let length = f64::from(seed.1[0]);
        // Noise in the metres of the query: with the scale unknown, the same share of the spacing.
        let sigma = match model.scale {
            Scale::Metric => model.sigma,
            Scale::Free => model.sigma / map.spacing * query.spacing,
        };
        if length < SHORTEST * sigma {
            return (found, effort);
        }
        let (mut runs, mut hits, common) = (Vec::new(), Vec::new(), common_in(index.quads.len()));
        near_ties(&query.points, seed.0, WITHIN * sigma, &mut |quad, code| {
            effort.codes += 1;
            let (code, radius) = match model.scale {
                Scale::Metric => (code, WITHIN * sigma),
                Scale::Free => (without_scale(&code), WITHIN * sigma / length),
            };
            hits.clear();
            index.codes.within(&code, radius as f32, &mut runs, |hit| hits.push(hit));
            effort.candidates += hits.len() as u64;
            // A shape that every cluster shows says nothing about the place.
            if hits.is_empty() || hits.len() > common {
                return;
            }
            let Some(proposer) = Proposer::new(query, map, &model, quad) else { return };
            let most = 2.0 * (WITHIN * model.sigma).powi(2);
            let targets = hits.iter().map(|&hit| &index.quads[hit as usize]);
            found.extend(targets.filter_map(|target| proposer.contender(target, most, &mut effort)));
        });
        (found, effort)
    }

    /// Candidates refined around their places, most evidence first.
    pub(super) fn refined(&self, candidates: &[Contender]) -> Vec<Hypothesis> {
        let starts: Vec<_> = candidates.iter().map(|one| (one.pose, one.place)).collect();
        refined([self.query, self.map], &self.model, REACH * self.query.spacing, &starts)
    }
}

/// Neighbours of a code that every cluster shows, in a map of no more seeds than this: some eight trees.
const COMMON: (f64, f64) = (48.0, 5e4);

/// Seeds whose code has more neighbours than this in a map of so many seeds are passed over.
///
/// A map of a thousand trees has as many more lookalikes of every seed. Were those passed over that have 48, hardly any seed
/// of a frame would be asked there; were as rare ones asked as in a row, they would cost as much more as the map is larger.
/// The root lies between.
fn common_in(seeds: usize) -> usize {
    let (most, usual) = COMMON;
    (most * (seeds as f64 / usual).max(1.0).sqrt()) as usize
}

/// One seed of every `stride`-th fruit for each of `turns`.
pub(crate) fn of_some_fruits(query: &Landscape, stride: u64, turns: std::ops::Range<u64>) -> Vec<Seed> {
    (0..query.len() as u32)
        .filter(|&row| shuffled(u64::from(row)).is_multiple_of(stride))
        .flat_map(|row| turns.clone().filter_map(move |turn| seed_of(query, row, turn)))
        .collect()
}

/// Radius of the region that weighs a refined hypothesis, in spacings.
pub(crate) const REACH: f64 = 3.5;
