//! From seeds to hypotheses: rounds of query seeds, their candidates in the map, the best of them refined.

use super::case::Search;
use super::hypothesis::{Hypothesis, Refiner};
use super::landscape::Landscape;
use super::placement::Placement;
use super::proposal::Proposer;
use super::seeds::{NEAR_TIE, Quad, SHORTEST, Seed, canonical, near_ties, shuffled, without_scale};
use super::vertical::Stands;
use crate::geometry::Scale;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::ops::Add;

/// A seed of the query laid on a seed of the map.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contender {
    pub(crate) pose: Placement,
    pub(crate) log_odds: f64,
    pub(crate) place: Vector3<f64>,
    /// Rows of both seeds: an order for equal evidence.
    pub(super) key: (Quad, Quad),
}

impl From<&Hypothesis> for Contender {
    fn from(found: &Hypothesis) -> Self {
        Self { pose: found.pose, log_odds: found.log_odds, place: found.place, key: Default::default() }
    }
}

/// Most evidence first.
pub(super) fn by_evidence(a: &Contender, b: &Contender) -> std::cmp::Ordering {
    b.log_odds.total_cmp(&a.log_odds).then(a.key.cmp(&b.key))
}

/// What a round cost.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Effort {
    pub(crate) codes: u64,
    pub(crate) candidates: u64,
    pub(crate) fitted: u64,
    /// How those stood that fit in space.
    pub(crate) stands: Stands,
}

impl Add for Effort {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            codes: self.codes + other.codes,
            candidates: self.candidates + other.candidates,
            fitted: self.fitted + other.fitted,
            stands: self.stands + other.stands,
        }
    }
}

/// The `turn`-th seed of a fruit: its three companions in a fixed shuffled order without repeats.
fn seed_of(query: &Landscape, row: u32, turn: u64) -> Option<Seed> {
    let near = query.neighbours(row as usize);
    let n = near.len().min(super::seeds::COMPANIONS) as u64;
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
    /// One round: candidates of all `seeds`, the best `keep` of them refined, and the other candidates in order.
    pub(super) fn round(&self, seeds: &[Seed], keep: usize) -> (Vec<Hypothesis>, Vec<Contender>, Effort) {
        let in_part = |seeds: &[Seed]| {
            let mut found = Vec::new();
            let efforts = seeds.iter().map(|&seed| self.candidates_of(seed, &mut found));
            let effort = efforts.fold(Effort::default(), Effort::add);
            (found, effort)
        };
        let parts: Vec<(Vec<Contender>, Effort)> = seeds.par_chunks(SHARE_OF_SEEDS).map(in_part).collect();
        let effort = parts.iter().fold(Effort::default(), |sum, part| sum + part.1);
        let mut candidates: Vec<Contender> = parts.into_iter().flat_map(|part| part.0).collect();
        candidates.sort_unstable_by(by_evidence);
        let best = distinct(self.query, self.map.spacing, &mut candidates, keep);
        (self.refined(&best), candidates, effort)
    }

    /// Candidates of one seed of the query that survive the fit and the first look.
    fn candidates_of(&self, seed: Seed, found: &mut Vec<Contender>) -> Effort {
        let Self { query, map, seeds: index, model, .. } = *self;
        let mut effort = Effort::default();
        let length = f64::from(seed.1[0]);
        // Noise in the metres of the query: with the scale unknown, the same share of the spacing.
        let sigma = match model.scale {
            Scale::Metric => model.sigma,
            Scale::Free => model.sigma / map.spacing * query.spacing,
        };
        if length < SHORTEST * sigma {
            return effort;
        }
        // Standard deviations that the two seeds may differ by.
        let apart = match model.scale {
            Scale::Metric => RADIUS * (length / (LONG * sigma)).clamp(1.0, WIDEST),
            Scale::Free => RADIUS,
        };
        let (mut runs, mut hits) = (Vec::new(), Vec::new());
        near_ties(&query.points, seed.0, NEAR_TIE * sigma, &mut |quad, code| {
            effort.codes += 1;
            let (code, radius) = match model.scale {
                Scale::Metric => (code, apart * sigma),
                Scale::Free => (without_scale(&code), apart * sigma / length),
            };
            hits.clear();
            index.codes.within(&code, radius as f32, &mut runs, |hit| hits.push(hit));
            effort.candidates += hits.len() as u64;
            if hits.len() > COMMON {
                return; // a shape that every cluster shows says nothing about the place
            }
            let Some(proposer) = Proposer::new(query, map, &model, quad) else { return };
            for &hit in &hits {
                let target = &index.quads[hit as usize];
                let Some((pose, residual)) = proposer.fit(target) else { continue };
                if residual > 2.0 * (apart * model.sigma).powi(2) {
                    continue;
                }
                effort.stands = effort.stands + proposer.stand(&pose);
                let Some(pose) = proposer.upright(pose) else { continue };
                effort.fitted += 1;
                let log_odds = proposer.first_look(&pose);
                if log_odds > 0.0 {
                    found.push(Contender { pose, log_odds, place: proposer.centroid, key: (quad, *target) });
                }
            }
        });
        effort
    }

    /// Candidates refined around their places, most evidence first.
    pub(super) fn refined(&self, candidates: &[Contender]) -> Vec<Hypothesis> {
        let reach = REACH * self.query.spacing;
        let refiner = || Refiner::new(self.query, self.map, &self.model);
        let refined = |refiner: &mut Refiner, one: &Contender| refiner.refine(&one.pose, &one.place, reach);
        let candidates = candidates.par_iter().with_min_len(SHARE_OF_CANDIDATES);
        let mut hypotheses: Vec<Hypothesis> = candidates.map_init(refiner, refined).flatten_iter().collect();
        hypotheses.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
        hypotheses
    }
}

/// Reach of the code search in standard deviations of one axis.
///
/// The residuals of a seed's fit, 12 - 6 degrees of freedom, may sum up to twice its square: 95 % of chi^2.
pub(super) const RADIUS: f64 = 2.5;

/// Seeds longer than this, in standard deviations, are searched as much more widely as they are longer, up to so many
/// times.
///
/// They bend more between visits, and where the noise is larger than expected they are found still. It costs little
/// where the length tells: a long seed has few lookalikes.
const LONG: f64 = 24.0;
const WIDEST: f64 = 2.0;

/// Seeds whose code has more neighbours in the map than this are passed over.
const COMMON: usize = 48;

/// One seed of every `stride`-th fruit for each of `turns`.
pub(crate) fn of_some_fruits(query: &Landscape, stride: u64, turns: std::ops::Range<u64>) -> Vec<Seed> {
    (0..query.len() as u32)
        .filter(|&row| shuffled(u64::from(row)).is_multiple_of(stride))
        .flat_map(|row| turns.clone().filter_map(move |turn| seed_of(query, row, turn)))
        .collect()
}

/// Seeds that are worth a thread of their own.
const SHARE_OF_SEEDS: usize = 32;

/// Takes the best `keep` candidates out of those given best first, one of each pose.
pub(super) fn distinct(
    query: &Landscape,
    map_spacing: f64,
    candidates: &mut Vec<Contender>,
    keep: usize,
) -> Vec<Contender> {
    let (near, same) = (query.spacing, SAME_PLACE * map_spacing);
    let mut kept: Vec<Contender> = Vec::new();
    candidates.retain(|candidate| {
        let place = candidate.place;
        let proposed = |other: &Contender| {
            (place - other.place).norm() < near
                && (candidate.pose.apply(&place) - other.pose.apply(&place)).norm() < same
                && candidate.pose.turn_to(&other.pose) < SAME_TURN_RAD
        };
        let new = kept.len() < keep && !kept.iter().any(proposed);
        if new {
            kept.push(*candidate);
        }
        !new
    });
    kept
}

/// Candidates of one neighbourhood are the same pose when they put it within this many spacings of one place, turned by
/// less than that: what one refinement reaches.
pub(super) const SAME_PLACE: f64 = 0.4;
const SAME_TURN_RAD: f64 = 0.15;

/// Candidates that are worth a thread of their own.
const SHARE_OF_CANDIDATES: usize = 8;

/// Radius of the region that weighs a refined hypothesis, in spacings.
pub(crate) const REACH: f64 = 3.5;
