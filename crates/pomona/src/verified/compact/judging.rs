//! What a large map answers: the best proposals, verified on what is cut out of the map around them.

use super::CompactMap;
use super::ground::Ground;
use super::proposing::{looks, proposals, within_budget};
use super::shapes::Shapes;
use crate::answer::{Match, Pair, Verdict};
use crate::cloud::FruitCloud;
use crate::geometry::{Scale, Similarity};
use crate::matching::Request;
use crate::verified::acceptance::VerifiedConfig;
use crate::verified::case::{Search, VerifiedMap, model_of};
use crate::verified::decision::{self, MIN_FRUITS, answer_of};
use crate::verified::hypothesis::Model;
use crate::verified::landscape::Landscape;
use crate::verified::placement::Placement;
use crate::verified::search::{Contender, Effort, REACH, Starts, by_evidence, distinct, refined};
use crate::verified::size::Diameters;
use nalgebra::Vector3;

/// Rounds of the search: candidates that each meets, more or less, and contenders that are looked at closely after it.
const ROUNDS: [(f32, usize); 3] = [(5e4, 32), (2e5, 64), (1e6, 256)];

/// Contenders that are verified as a whole.
const WHOLE: usize = 12;

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
        return Match::without_answer(Verdict::TooFew, vec![("fruits_needed", MIN_FRUITS as f64)]);
    }
    let landscape = Landscape::new(query);
    let case = Case {
        index,
        map,
        query,
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
    in_map(decision::pairs_under(&prepared, &part, query, map_from_query, request, config), &rows)
}

/// One query against one large map.
struct Case<'a> {
    index: &'a CompactMap,
    map: &'a FruitCloud,
    query: &'a FruitCloud,
    landscape: &'a Landscape,
    ground: Ground<'a>,
    model: Model,
    request: &'a Request,
    config: &'a VerifiedConfig,
}

impl Case<'_> {
    /// Rounds that meet more and more candidates, until one finds an answer.
    fn run(&self) -> Match {
        let (shapes, step) = (Shapes::new(self.index), self.index.facts.step);
        let looks = looks(self.landscape, &shapes, &self.model, step);
        let (mut rest, mut effort) = (&looks[..], Effort::default());
        let mut contenders = Vec::new();
        let mut answer = Match::without_answer(Verdict::NoMatch, Vec::new());
        for (budget, closely) in ROUNDS {
            let (now, later) = rest.split_at(within_budget(rest, budget));
            rest = later;
            if now.is_empty() {
                continue;
            }
            let (more, spent) = proposals(self.landscape, (&self.ground, &shapes), &self.model, now, step);
            effort = effort + spent;
            contenders.extend(more);
            contenders.sort_unstable_by(by_evidence);
            contenders.truncate(REMEMBERED);
            answer = self.judged(contenders.clone(), closely, effort);
            if answer.verdict != Verdict::NoMatch {
                break;
            }
        }
        answer
    }

    /// The answer that the contenders give, most evidence first.
    fn judged(&self, mut contenders: Vec<Contender>, closely: usize, effort: Effort) -> Match {
        let best = distinct(self.landscape, self.index.facts.spacing, &mut contenders, closely);
        let mut whole = self.looked_at(&best);
        let whole = distinct(self.landscape, self.index.facts.spacing, &mut whole, WHOLE);
        let rows = self.rows_around(&whole, f64::INFINITY);
        let part = cut(self.map, &rows);
        let prepared = VerifiedMap::part(&part, self.index.facts.spacing, self.map.len());
        let sizes = Diameters::new(self.query, &part, self.landscape, &prepared.landscape);
        let search = Search::new(&prepared, self.landscape, sizes, self.request, self.config);
        let moved: Vec<Contender> = whole.iter().map(|one| one.moved(-prepared.landscape.centre)).collect();
        in_map(answer_of(&search, search.weigh(&moved, effort)), &rows)
    }

    /// The contenders refined on what is next to their seeds.
    fn looked_at(&self, contenders: &[Contender]) -> Vec<Contender> {
        let rows = self.rows_around(contenders, REACH * self.landscape.spacing);
        let part = Landscape::part(&cut(self.map, &rows), self.index.facts.spacing);
        let moved: Vec<Contender> = contenders.iter().map(|one| one.moved(-part.centre)).collect();
        let refined = refined(self.landscape, &part, &moved, &self.model, Starts::Turned);
        refined.iter().map(|found| Contender::from(found).moved(part.centre)).collect()
    }

    /// The fruits of the map where the contenders put what of the query is within `reach` of their seeds.
    fn rows_around(&self, contenders: &[Contender], reach: f64) -> Vec<u32> {
        let mut rows: Vec<u32> = contenders
            .iter()
            .flat_map(|one| {
                let near = |p: &&Vector3<f64>| (**p - one.place).norm() <= reach;
                let places = self.landscape.points.iter().filter(near).map(|p| one.pose.apply(p));
                self.ground.around(places, MARGIN)
            })
            .collect();
        rows.sort_unstable();
        rows.dedup();
        rows
    }
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
        let pose = Placement { translation: self.pose.translation + by, ..self.pose };
        Self { pose, ..*self }
    }
}
