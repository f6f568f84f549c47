//! An answer that the threshold is too high for: a pose that stands out of all others that the search found.
//!
//! The threshold of [`super::acceptance`] is what chance reaches over clouds of this size anywhere. What it reaches in these
//! very clouds the other optima of the search show, found and refined as the answer was. Of rows laid along rows only these can
//! tell: the threshold does not know what rows on rows meet.

use super::acceptance::outlying;
use super::case::{Finding, Log, Search};
use super::contender::first_of_each;

/// Evidence, in nats, that chance is taken to reach in any search: the best wrong poses of small frames have 15 in the median,
/// and below this they are not yet in the tail.
const REACHED: f64 = 12.0;

impl<'a> Search<'a> {
    /// Takes the best pose out of those that were not accepted, where it stands out of the others, has the `least` evidence and
    /// keeps the shares `kept` of what is asked for.
    pub(super) fn single_out(
        &self,
        others: &mut Vec<Finding<'a>>,
        least: f64,
        kept: [f64; 2],
        log: &mut Log,
    ) -> Option<Finding<'a>> {
        others.sort_by(|a, b| b.overlap.log_odds.total_cmp(&a.overlap.log_odds));
        let distinct = self.distinct(others);
        distinct.first().filter(|&&best| self.model.admits(&others[best].overlap.pose))?;
        let stands_out = outlying(self.config.false_alarm_rate, self.second(others, &distinct));
        let best = evidence(others, distinct[0]);
        if best <= stands_out {
            return None;
        }
        log.best = log.best.max(best);
        log.threshold = stands_out.max(least);
        let best = &mut others[distinct[0]];
        (self.holds(best, kept, log) && self.stands_out_of_the_planting(best, 1.0) != Some(false))
            .then(|| others.swap_remove(distinct[0]))
    }

    /// Whether one of these could stand out, whatever else the search may show.
    pub(super) fn may_stand_out(&self, others: &[Finding]) -> bool {
        let least = outlying(self.config.false_alarm_rate, REACHED);
        (0..others.len()).any(|at| evidence(others, at) > least)
    }

    /// Most evidence of those after the best, each by the share that it puts elsewhere: a row turned a little, about its middle
    /// or an end, has the rest from the best.
    fn second(&self, findings: &[Finding], distinct: &[usize]) -> f64 {
        let best = &findings[distinct[0]].overlap;
        let of = |&at: &usize| self.elsewhere(best, &findings[at].overlap) * evidence(findings, at);
        distinct[1..].iter().map(of).fold(REACHED, f64::max)
    }

    /// Those of `findings`, most evidence first, that lie apart from all before them.
    fn distinct(&self, findings: &[Finding]) -> Vec<usize> {
        let same = |&at: &usize, &better: &usize| !self.apart(&findings[better].overlap, &findings[at].overlap);
        first_of_each(0..findings.len(), findings.len(), same)
    }
}

fn evidence(findings: &[Finding], at: usize) -> f64 {
    findings[at].overlap.log_odds
}
