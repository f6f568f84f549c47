//! A query of which it is known to a few decimetres where it lies: what seeds this lays on each other, in place of an index.
//!
//! To make the index of a map and to look seeds up in it costs as much as all that follows. Where the query is expected
//! somewhere, the fruits of the map that a seed may be are those near it. Which of these poses is the best, and what
//! grows out of it, follows from the two clouds alone: by how much the expectation is off changes nothing. An answer
//! that leaves a doubt is none: the other poses that would rule it out were not looked for.

use super::acceptance::{SURE, VerifiedConfig};
use super::case::{Search, VerifiedMap};
use super::congruent::each_alike_among;
use super::contender::{Contender, REFINED, by_evidence, distinct};
use super::decision::MIN_FRUITS;
use super::proposal::{Effort, Proposer};
use super::search::of_some_fruits;
use super::seeds::{SHORTEST, Seed, WITHIN};
use super::vertical::Vertical;
use crate::answer::{Match, Verdict};
use crate::geometry::{Scale, Similarity};
use crate::matching::Request;

/// Fruits whose seeds are laid on the map, at the most.
const FRUITS: usize = 128;

/// Finds the query in the map where it is expected; `NoMatch` where that leaves a doubt. Both are there without seeds.
pub(crate) fn search_expected(
    query: &VerifiedMap,
    map: &VerifiedMap,
    map_from_query: &Similarity,
    request: &Request,
    config: &VerifiedConfig,
) -> Match {
    let search = Search::new(map, &query.landscape, request, config);
    if search.query.len().min(search.map.len()) < MIN_FRUITS {
        return Match::too_few();
    }
    if request.scale != Scale::Metric {
        return Match::without_answer(Verdict::NoMatch, Vec::new());
    }
    let expected = map_from_query.about(&search.query.centre, &search.map.centre);
    let contenders = search.contenders(&expected);
    let findings = search.weigh(&contenders, Effort::default());
    let least = SURE * search.threshold(Vertical::share_of_turns());
    if findings.accepted.first().is_some_and(|best| best.overlap.log_odds > least) {
        search.answer_of(findings)
    } else {
        Match::without_answer(Verdict::NoMatch, search.stages(&findings))
    }
}

impl Search<'_> {
    /// The best poses that lay a seed of the query on fruits near where it is expected.
    fn contenders(&self, expected: &Similarity) -> Vec<Contender> {
        let seeds = of_some_fruits(self.query, self.query.len().div_ceil(FRUITS) as u64, 0..1);
        let mut found = Vec::new();
        for seed in &seeds {
            self.lay(seed, expected, &mut found);
        }
        found.sort_unstable_by(by_evidence);
        distinct(self.query, self.map.spacing, &found, REFINED)
    }

    fn lay(&self, &(quad, code): &Seed, expected: &Similarity, found: &mut Vec<Contender>) {
        if f64::from(code[0]) < SHORTEST * self.model.sigma {
            return;
        }
        let Some(proposer) = Proposer::new(self.query, self.map, &self.model, quad) else { return };
        let fruits = quad.map(|row| self.query.points[row as usize]);
        // A fruit may be off by a spacing from where it is expected: 27 cm in an orchard.
        let near = fruits.map(|fruit| self.map.within(&expected.image(&fruit), self.map.spacing));
        let most = 2.0 * (WITHIN * self.model.sigma).powi(2);
        let effort = &mut Effort::default();
        let lists = near.each_ref().map(Vec::as_slice);
        each_alike_among(&fruits, self.map, lists, WITHIN * self.model.sigma, &mut |target| {
            found.extend(proposer.contender(&target, most, effort));
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::config::Config;
    use crate::verified::fixture::visits;
    use nalgebra::{Rotation3, Vector3};

    fn asked(query: &FruitCloud, map: &FruitCloud, expected: &Similarity) -> Match {
        let [ready, prepared] = [query, map].map(VerifiedMap::without_seeds);
        search_expected(&ready, &prepared, expected, &Request::default(), &Config::default().verified)
    }

    #[test]
    fn what_is_found_does_not_follow_the_expectation_nor_differ_from_a_search() {
        let (query, map) = visits(0.01);
        let request = Request::default();
        let config = Config::default();
        let prepared = VerifiedMap::new(&map, Scale::Metric);
        let searched = super::super::search(&prepared, &query, &request, &config.verified);
        let [first, second] = [0.0, 0.02].map(|off: f64| {
            let turn = Rotation3::new(Vector3::new(off, -off, off));
            asked(&query, &map, &Similarity::rigid(turn, Vector3::new(off, 3.0 * off, -off)))
        });
        assert_eq!(first.verdict, Verdict::Found);
        let facts = |found: &Match| found.pairs.iter().map(|p| (p.query, p.map, p.probability)).collect::<Vec<_>>();
        assert_eq!(facts(&first), facts(&second));
        let pairs = |found: &Match| found.pairs.iter().map(|p| (p.query, p.map)).collect::<Vec<_>>();
        let (here, there) = (pairs(&first), pairs(&searched));
        let same = here.iter().filter(|pair| there.contains(pair)).count();
        assert!(100 * same >= 99 * here.len().max(there.len()), "{same} of {} and {}", here.len(), there.len());
    }

    #[test]
    fn where_nothing_is_nothing_is_found() {
        let (query, map) = visits(0.01);
        let aside = Similarity { translation: Vector3::new(2.0, 0.0, 0.0), ..Similarity::identity() };
        assert_eq!(asked(&query, &map, &aside).verdict, Verdict::NoMatch);
    }
}
