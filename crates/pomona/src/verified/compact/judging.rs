//! What a large map answers: the best proposals, verified on what is cut out of the map around them.

use super::CompactMap;
use super::closer::closer;
use super::ground::Ground;
use super::proposing::{looks, proposals, within_budget};
use super::shapes::Shapes;
use crate::answer::{Match, Pair, Verdict};
use crate::cloud::FruitCloud;
use crate::geometry::{Scale, Similarity};
use crate::matching::Request;
use crate::verified::acceptance::VerifiedConfig;
use crate::verified::case::{Search, VerifiedMap, model_of};
use crate::verified::contender::{Contender, by_evidence, distinct};
use crate::verified::decision::{self, MIN_FRUITS, RIVAL_SEED};
use crate::verified::hypothesis::Model;
use crate::verified::landscape::Landscape;
use crate::verified::proposal::Effort;
use crate::verified::search::REACH;
use nalgebra::Vector3;

/// Rounds of the search: what the looks of each may cost, in candidates, and contenders that are looked at more closely after
/// it. Each costs as much as all before it, so that what is found costs twice of what it had to at the most.
const ROUNDS: [(f32, usize); 10] = [
    (8e3, 32),
    (8e3, 32),
    (1.6e4, 32),
    (3.2e4, 48),
    (6.4e4, 64),
    (1.28e5, 96),
    (2.56e5, 128),
    (5.12e5, 256),
    (1.024e6, 512),
    (2.048e6, 1024),
];

/// Candidates of a round, the best at a glance, that get a first look, for each that gets a closer one.
const LOOKED_AT: usize = 96;

/// Contenders that are verified as a whole.
const WHOLE: usize = 12;

/// Nats by which the best contender has to stand out of those of other poses to be verified before the last round.
const STANDS_OUT: f64 = 6.0;

/// Poses are one where they put the seed of one of them within so many spacings of one place, turned by less than that.
const SAME_PLACE: f64 = 1.0;
const SAME_TURN_RAD: f64 = 0.2;

/// Contenders that are verified of those that lay the middle of the query within the reach of a seed's evidence: others show what
/// chance reaches.
const OF_ONE_SPOT: usize = 2;

/// Contenders that are remembered from round to round.
const REMEMBERED: usize = 4096;

/// Cells around the query, of a spacing each, that are cut out of the map with it: the kernels of its density reach as far.
const MARGIN: i64 = 2;

/// Finds the query in the map.
pub(crate) fn search(
    index: &CompactMap,
    map: &FruitCloud,
    query: &FruitCloud,
    request: &Request,
    config: &VerifiedConfig,
) -> Match {
    if query.len() < MIN_FRUITS || map.len() < MIN_FRUITS {
        return Match::too_few();
    }
    let landscape = Landscape::new(query);
    let case = Case {
        index,
        map,
        landscape: &landscape,
        ground: Ground::new(index),
        model: model_of(index.facts.spacing, Scale::Metric, request),
        request,
        config,
    };
    case.run()
}

/// Pairs of two clouds whose pose is known.
pub(crate) fn pairs_under(
    index: &CompactMap,
    map: &FruitCloud,
    query: &FruitCloud,
    map_from_query: &Similarity,
    request: &Request,
    config: &VerifiedConfig,
) -> Match {
    let places = query.positions.iter().map(|p| map_from_query.apply(p).coords);
    let rows = Ground::new(index).around(places, MARGIN);
    let part = cut(map, &rows);
    let prepared = VerifiedMap::part(&part, index.facts.spacing, map.len());
    in_map(decision::pairs_under(&prepared, query, map_from_query, request, config), &rows)
}

/// One query against one large map.
struct Case<'a> {
    index: &'a CompactMap,
    map: &'a FruitCloud,
    landscape: &'a Landscape,
    ground: Ground<'a>,
    model: Model,
    request: &'a Request,
    config: &'a VerifiedConfig,
}

impl Case<'_> {
    /// Rounds that meet more and more candidates, until one finds an answer.
    fn run(&self) -> Match {
        let shapes = Shapes::new(self.index);
        let looks = looks(self.landscape, &shapes, &self.model, self.index.facts.step);
        let (mut rest, mut effort) = (&looks[..], Effort::default());
        let (mut contenders, mut closely, mut best) = (Vec::new(), Vec::new(), Vec::new());
        let mut judged = None;
        for (budget, count) in ROUNDS {
            let (now, later) = rest.split_at(within_budget(rest, budget));
            rest = later;
            let most = LOOKED_AT * count;
            let (more, spent) = proposals(self.landscape, (&self.ground, &shapes), &self.model, now, most);
            effort = effort + spent;
            contenders.extend(more);
            contenders.sort_unstable_by(by_evidence);
            contenders.truncate(REMEMBERED);
            closely.extend(self.looked_at(&mut contenders, count));
            closely.sort_unstable_by(by_evidence);
            best = self.of_other_poses(&closely);
            // What was judged before is so little again.
            let some = outstanding(&best).filter(|some| judged.replace(some[0].key) != Some(some[0].key));
            let answer = some.map(|some| self.judged(some, effort));
            if let Some(answer) = answer.filter(|answer| answer.verdict != Verdict::NoMatch) {
                return answer;
            }
            if rest.is_empty() {
                break;
            }
        }
        self.judged(&best, effort)
    }

    /// The best contenders on a closer look; they are taken out of the others.
    fn looked_at(&self, contenders: &mut Vec<Contender>, count: usize) -> Vec<Contender> {
        let best = distinct(self.landscape, self.index.facts.spacing, contenders, count);
        contenders.retain(|one| best.iter().all(|other| other.key != one.key));
        closer(self.landscape, &self.ground, &self.model, &best)
    }

    /// Of contenders, most evidence first, those whose pose no better one has; as many as are verified.
    fn of_other_poses(&self, contenders: &[Contender]) -> Vec<Contender> {
        let spot = REACH * self.landscape.spacing;
        let mut kept: Vec<Contender> = Vec::new();
        for one in contenders {
            let apart = |other: &Contender| (one.pose.image(&one.place) - other.pose.image(&one.place)).norm();
            let same = |other: &Contender| {
                apart(other) < SAME_PLACE * self.index.facts.spacing && one.pose.turn_to(&other.pose) < SAME_TURN_RAD
            };
            let near = |other: &&Contender| (one.pose.translation - other.pose.translation).norm() < spot;
            if kept.len() < WHOLE && !kept.iter().any(same) && kept.iter().filter(near).count() < OF_ONE_SPOT {
                kept.push(*one);
            }
        }
        kept
    }

    /// The answer that the contenders give, most evidence first.
    fn judged(&self, contenders: &[Contender], effort: Effort) -> Match {
        let rows = self.rows_around(contenders);
        let part = cut(self.map, &rows);
        let prepared = VerifiedMap::part(&part, self.index.facts.spacing, self.map.len());
        let search = Search::new(&prepared, self.landscape, self.request, self.config);
        let moved: Vec<Contender> = contenders.iter().map(|one| one.moved(-prepared.landscape.centre)).collect();
        in_map(search.answer_of(search.weigh(&moved, effort)), &rows)
    }

    /// The fruits of the map where the contenders put the query.
    fn rows_around(&self, contenders: &[Contender]) -> Vec<u32> {
        let places = |one: &Contender| {
            let pose = one.pose;
            self.landscape.points.iter().map(move |p| pose.image(p))
        };
        let mut rows: Vec<u32> = contenders.iter().flat_map(|one| self.ground.around(places(one), MARGIN)).collect();
        rows.sort_unstable();
        rows.dedup();
        rows
    }
}

/// The best contender and its rivals, where it stands out.
fn outstanding(contenders: &[Contender]) -> Option<&[Contender]> {
    let best = contenders.first()?.log_odds;
    let second = contenders.get(1).map_or(0.0, |one| one.log_odds.max(0.0));
    let rivals = contenders.iter().take_while(|one| one.log_odds >= RIVAL_SEED * best).count();
    (best > STANDS_OUT + second).then(|| &contenders[..rivals])
}

fn cut(map: &FruitCloud, rows: &[u32]) -> FruitCloud {
    let rows: Vec<usize> = rows.iter().map(|&row| row as usize).collect();
    map.select(&rows)
}

/// An answer of what was cut out, in the rows of the map.
fn in_map(mut found: Match, rows: &[u32]) -> Match {
    let of_map = |pair: &mut Pair| pair.map = rows[pair.map] as usize;
    found.pairs.iter_mut().for_each(of_map);
    found
}

impl Contender {
    /// The same where the map's origin is elsewhere.
    fn moved(&self, by: Vector3<f64>) -> Self {
        let pose = Similarity { translation: self.pose.translation + by, ..self.pose };
        Self { pose, ..*self }
    }
}
