//! The answer to a query: the best finding, its pairs, its rivals.

use super::acceptance::{CLEAR_OF_PATTERNS, PATTERN};
use super::case::{Finding, Findings, Search};
use super::doubts::Rated;
use super::overlap::Overlap;
use super::settlement::Settled;
use crate::answer::{Match, Pair, Registration, Verdict};
use crate::beliefs::{Beliefs, Edge};
use crate::geometry::Similarity;

impl<'a> Search<'a> {
    /// The answer to what was found.
    pub(super) fn answer_of(&self, mut findings: Findings<'a>) -> Match {
        self.join(&mut findings.accepted);
        // Parts that stand together may leave each other fewer pairs than speak for one.
        if findings.accepted.first().is_some_and(|best| self.believed(best) == 0.0) {
            findings.accepted.clear();
        }
        let mut stages = self.stages(&findings);
        if findings.accepted.first().is_some_and(|best| self.fits_better_mirrored(best, &findings.log)) {
            stages.push(("mirrored", 1.0));
            findings.accepted.clear();
        }
        self.answer(findings, stages)
    }

    /// The best of the accepted findings; `NoMatch` where one that is not accepted has nearly as much evidence.
    ///
    /// The other optima of the same search show what wrong poses reach on this very planting.
    pub(super) fn answer(&self, findings: Findings, mut stages: Vec<(&'static str, f64)>) -> Match {
        let Findings { accepted, others, log } = findings;
        let pattern = self.reached(PATTERN, log.effort.stands.share_left());
        let mut accepted = accepted.into_iter();
        let best = accepted.next();
        let Some((found, settled)) = best.as_ref().and_then(|found| Some((found, found.settled.as_ref()?))) else {
            return Match::without_answer(Verdict::NoMatch, stages);
        };
        let overlap = Overlap { log_odds: found.overlap.log_odds, ..settled.overlap.clone() };
        let best = Rated { overlap: &overlap, nats: found.overlap.log_odds.max(found.evidence()) };
        let mut pairs = self.pairs(found);
        let is_new = |other: &Finding| found.further.iter().all(|part| !self.shows(&part.overlap, &other.overlap));
        let is_outdone_by = |other: &Finding| is_new(other) && self.outdoes(best, other.rated(), pattern);
        let outdone =
            others.iter().any(is_outdone_by) && self.stands_out_of_the_planting(found, CLEAR_OF_PATTERNS) != Some(true);
        let (rivals, accepted): (Vec<_>, Vec<_>) =
            accepted.partition(|other| is_new(other) && self.excludes(best, other.rated(), pattern));
        // What is neither a rival nor a further part shows what one stem has in common with others.
        let alone = Rated { nats: found.overlap.log_odds.max(settled.evidence), ..best };
        let is_as_good =
            |other: &Finding| !self.may_be_torn_off(other, found) && is_new(other) && self.equals(alone, other.rated());
        let outdone = outdone || accepted.iter().any(is_as_good) || self.stems_lie_elsewhere(found, &log);
        stages.extend([("rivals", f64::from(outdone)), ("pairs", pairs.len() as f64)]);
        if outdone {
            return Match::without_answer(Verdict::NoMatch, stages);
        }
        let mut rivals: Vec<Registration> = rivals.iter().map(|finding| self.registration(&finding.overlap)).collect();
        if rivals.is_empty() {
            rivals.extend(self.unseen_rival(best, found, &log).map(|rival| self.registration(&rival)));
        }
        // What was measured does not tell the poses apart: the pairs are those of one of them.
        let poses = (1 + rivals.len()) as f64;
        for pair in &mut pairs {
            pair.probability /= poses;
        }
        Match {
            verdict: if rivals.is_empty() { Verdict::Found } else { Verdict::Ambiguous },
            registration: Some(self.registration(&overlap)),
            further: found.further.iter().map(|part| self.registration(&part.overlap)).collect(),
            alternatives: rivals,
            pairs,
            noise_m: overlap.sigma,
            stages,
        }
    }

    /// One-to-one pairs of all parts in the rows of the clouds, in the order of the query.
    fn pairs(&self, found: &Finding) -> Vec<Pair> {
        let (query, map) = (self.query, self.map);
        let pair = |(edge, probability): (Edge, f64)| {
            let off = |(part, settled): (usize, &Settled)| {
                let at = settled.overlap.predictions[edge.query as usize]?.place;
                Some((part, (map.points[edge.map as usize] - at).norm()))
            };
            let nearest = |one: &(usize, f64), other: &(usize, f64)| one.1.total_cmp(&other.1);
            let (part, distance_m) = found.of_all_parts().enumerate().filter_map(off).min_by(nearest)?;
            Some(Pair {
                query: query.rows[edge.query as usize] as usize,
                map: map.rows[edge.map as usize] as usize,
                probability,
                distance_m,
                support: edge.ratio.ln(),
                part,
            })
        };
        let all = Beliefs::of_lists(found.of_all_parts().map(|settled| &settled.beliefs));
        let chosen = all.chosen(query.len(), map.len(), self.config.min_probability);
        let mut pairs: Vec<Pair> = chosen.into_iter().filter_map(pair).collect();
        pairs.sort_unstable_by_key(|pair| pair.query);
        pairs
    }

    /// What the search did, by stages.
    pub(super) fn stages(&self, Findings { accepted, log, .. }: &Findings) -> Vec<(&'static str, f64)> {
        vec![
            ("query_fruits", self.query.len() as f64),
            ("map_fruits", self.map.len() as f64),
            ("map_seeds", self.prepared.seeds.quads.len() as f64),
            ("query_codes", log.effort.codes as f64),
            ("candidates", log.effort.candidates as f64),
            ("fitted", log.effort.fitted as f64),
            ("refined", log.refined as f64),
            ("grown", log.grown as f64),
            ("threshold_nats", log.threshold),
            ("best_nats", log.best),
            ("settled_threshold_nats", log.settled_threshold),
            ("settled_nats", log.settled),
            ("verified", accepted.len() as f64),
            ("parts", accepted.first().map_or(0, |best| best.of_all_parts().count()) as f64),
        ]
    }

    fn registration(&self, overlap: &Overlap) -> Registration {
        let Similarity { mut rotation, translation, scale } = overlap.pose;
        rotation.renormalize();
        let translation = self.map.centre + translation - rotation * self.query.centre * scale;
        Registration { map_from_query: Similarity { rotation, translation, scale }, log_odds: overlap.log_odds }
    }
}
