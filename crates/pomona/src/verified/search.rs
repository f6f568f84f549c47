//! From seeds to hypotheses: rounds of query seeds, their candidates in the map, the best of them refined.

use super::hypothesis::{Hypothesis, Model, Scratch, refine};
use super::landscape::Landscape;
use super::placement::Placement;
use super::proposal::Proposer;
use super::seeds::{NEAR_TIE, Quad, SHORTEST, Seed, SeedIndex, canonical, near_ties, shuffled, without_scale};
use super::vertical::Stands;
use crate::geometry::Scale;
use nalgebra::Vector3;
use rayon::prelude::*;

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

impl std::ops::Add for Effort {
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
    let [a, b, c] = unrank((key % count + turn * stride) % count);
    let pick = |i: u64| near[i as usize];
    canonical(&query.points, [row, pick(a), pick(b), pick(c)])
}

/// The `rank`-th triple a < b < c in colexicographic order.
fn unrank(rank: u64) -> [u64; 3] {
    let mut c = 2;
    while (c + 1) * c * (c - 1) / 6 <= rank {
        c += 1;
    }
    let rest = rank - c * (c - 1) * (c - 2) / 6;
    let mut b = 1;
    while (b + 1) * b / 2 <= rest {
        b += 1;
    }
    [rest - b * (b - 1) / 2, b, c]
}

/// Candidates of one seed of the query that survive the fit and the first look.
fn candidates_of(
    query: &Landscape,
    map: &Landscape,
    index: &SeedIndex,
    model: &Model,
    seed: Seed,
    found: &mut Vec<Contender>,
) -> Effort {
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
        let Some(proposer) = Proposer::new(query, map, model, quad) else { return };
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

/// One round: candidates of all `seeds`, the best `keep` of them refined, and the other candidates in order.
pub(crate) fn round(
    query: &Landscape,
    map: &Landscape,
    index: &SeedIndex,
    model: &Model,
    seeds: &[Seed],
    keep: usize,
) -> (Vec<Hypothesis>, Vec<Contender>, Effort) {
    let parts: Vec<(Vec<Contender>, Effort)> = seeds
        .par_chunks(SHARE_OF_SEEDS)
        .map(|seeds| {
            let mut found = Vec::new();
            let mut effort = Effort::default();
            for &seed in seeds {
                effort = effort + candidates_of(query, map, index, model, seed, &mut found);
            }
            (found, effort)
        })
        .collect();
    let effort = parts.iter().fold(Effort::default(), |sum, part| sum + part.1);
    let mut candidates: Vec<Contender> = parts.into_iter().flat_map(|part| part.0).collect();
    candidates.sort_unstable_by(by_evidence);
    let best = distinct(query, map.spacing, &mut candidates, keep);
    (refined(query, map, &best, model), candidates, effort)
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

/// Candidates refined around their places, most evidence first.
pub(crate) fn refined(query: &Landscape, map: &Landscape, candidates: &[Contender], model: &Model) -> Vec<Hypothesis> {
    let reach = REACH * query.spacing;
    let refined = |scratch: &mut Scratch, Contender { pose, place, .. }: &Contender| {
        refine(query, map, pose, place, reach, model, scratch)
    };
    let mut hypotheses: Vec<Hypothesis> = candidates
        .par_iter()
        .with_min_len(SHARE_OF_CANDIDATES)
        .map_init(Scratch::default, refined)
        .flatten_iter()
        .collect();
    hypotheses.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
    hypotheses
}

/// Candidates that are worth a thread of their own.
const SHARE_OF_CANDIDATES: usize = 8;

/// Radius of the region that weighs a refined hypothesis, in spacings.
pub(crate) const REACH: f64 = 3.5;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verified::fixture::{Dice, visits};
    use nalgebra::Rotation3;

    #[test]
    fn ranks_walk_through_all_triples_once() {
        let mut triples: Vec<[u64; 3]> = (0..120).map(unrank).collect();
        assert!(triples.iter().all(|t| t[0] < t[1] && t[1] < t[2] && t[2] < 10));
        triples.sort_unstable();
        triples.dedup();
        assert_eq!(triples.len(), 120);
    }

    #[test]
    fn turned_starts_reach_the_true_pose_from_fifteen_degrees() {
        let (query, map) = visits(0.02);
        let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
        let model = Model { sigma: 0.02, detection: 0.6, scale: Scale::Metric, vertical: None };
        let truth = Placement { translation: query.centre - map.centre, ..Placement::identity() };
        let mut dice = Dice(11);
        let (mut straight_reached, mut turned_reached) = (0, 0);
        for i in 0..20 {
            let place = query.points[i * query.len() / 20];
            let pose = truth.turned(&place, &Rotation3::new(dice.normal().normalize() * 0.26));
            let candidate = Contender { pose, log_odds: 0.0, place, key: ([0; 4], [0; 4]) };
            let [straight, turned] = [Starts::Straight, Starts::Turned]
                .map(|starts| refined(&query, &map, &[candidate], &model, starts).pop());
            let reached =
                |one: &Option<Hypothesis>| one.is_some_and(|one| one.pose.turn_to(&truth) < 5f64.to_radians());
            straight_reached += u32::from(reached(&straight));
            turned_reached += u32::from(reached(&turned));
            let evidence = |one: Option<Hypothesis>| one.map_or(f64::NEG_INFINITY, |one| one.log_odds);
            assert!(evidence(turned) >= evidence(straight));
        }
        assert!(turned_reached >= 17, "{turned_reached} of 20");
        assert!(turned_reached > straight_reached, "{straight_reached} without turning");
    }
}
