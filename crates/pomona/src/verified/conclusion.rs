//! The answer to a query: the best finding settled, its pairs, its rivals.

use super::decision::{Finding, Search, Stages};
use super::overlap::Overlap;
use super::pairing::Pairing;
use super::settlement::{Settled, settle};
use super::size::Diameters;
use crate::answer::{Match, Pair, Registration, Verdict};
use crate::cloud::FruitCloud;

impl Search<'_> {
    /// The best finding settled; `NoMatch` where its pairs say less than `least_told`, nats.
    pub(super) fn answer(
        &self,
        mut findings: Vec<Finding>,
        map: &FruitCloud,
        query: &FruitCloud,
        least_told: Option<f64>,
        mut stages: Stages,
    ) -> Match {
        if findings.is_empty() {
            return Match::without_answer(Verdict::NoMatch, stages);
        }
        let best = findings.remove(0);
        let sizes = Diameters::new(query, map, self.query, self.map);
        let Settled { overlap, marginals } = settle(&best.growth, self.noise_m, sizes.as_ref());
        if let Some(least) = least_told {
            let told = marginals.told();
            stages.extend([("settled_threshold_nats", least), ("settled_nats", told)]);
            if told < least {
                return Match::without_answer(Verdict::NoMatch, stages);
            }
        }
        let overlap = Overlap { log_odds: best.overlap.log_odds, ..overlap };
        let rivals: Vec<Registration> = findings
            .iter()
            .map(|finding| &finding.overlap)
            .filter(|other| self.rivals(&overlap, other))
            .map(|other| self.registration(other))
            .collect();
        let pairs = marginals.pairs(self.query.len(), self.map.len(), self.config.min_probability);
        stages.push(("pairs", pairs.len() as f64));
        Match {
            verdict: if rivals.is_empty() { Verdict::Found } else { Verdict::Ambiguous },
            registration: Some(self.registration(&overlap)),
            alternatives: rivals,
            pairs: self.in_rows(&pairs),
            noise_m: overlap.sigma,
            stages,
        }
    }

    /// Pairs in the rows of the clouds, in the order of the query.
    fn in_rows(&self, pairs: &[Pairing]) -> Vec<Pair> {
        let mut pairs: Vec<Pair> = pairs
            .iter()
            .map(|pair| Pair {
                query: self.query.rows[pair.query as usize] as usize,
                map: self.map.rows[pair.map as usize] as usize,
                probability: pair.probability,
                distance_m: pair.distance,
                support: pair.gain,
            })
            .collect();
        pairs.sort_unstable_by_key(|pair| pair.query);
        pairs
    }

    fn registration(&self, overlap: &Overlap) -> Registration {
        Registration {
            map_from_query: overlap.pose.to_similarity(&self.query.centre, &self.map.centre),
            log_odds: overlap.log_odds,
        }
    }
}
