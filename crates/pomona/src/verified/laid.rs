//! A row laid along a row: whether what the offsets of all fruits propose is an answer.
//!
//! Rows that lie on rows, as most turns that a known vertical leaves lay them, meet more than the threshold allows for. How much
//! more the other poses of this search show: the answer must stand out of them.

use super::acceptance::{KEPT, outlying};
use super::case::{Finding, Findings, Search};
use super::growth::lay;
use super::hypothesis::{Hypothesis, Model};
use super::offsets;
use super::settlement::SELDOM;
use super::soft;
use rayon::prelude::*;

/// Evidence, in nats, that a row laid along a row has to be held: strangers have 5 to 16 there, true poses 27 and more.
const LEAST_LAID: f64 = 10.0;

/// Evidence, in nats, that chance is taken to reach wherever rows are laid along rows, however few other poses a search shows:
/// the best wrong ones of crowns and hedges have 17 in the median, more than those of seeds.
const REACHED_LAID: f64 = 17.0;

/// A row laid along a row of which less than this share is found, of what the map can show of it, is a stranger: half of what is
/// assumed. Strangers show up to 0.12, true poses 0.13 and more, 0.24 in the median where a fruit in ten is in common.
const LEAST_AGAIN: f64 = 0.5 * offsets::FEW_AGAIN;

impl<'a> Search<'a> {
    /// Asks the offsets of all fruits, where too few are in common for any seed.
    pub(super) fn lay_along(&self, Findings { accepted, others, log, .. }: &mut Findings<'a>) {
        let few = offsets::few_again(self.map, &self.model);
        let hypotheses = offsets::hypotheses(self.query, self.map, &few);
        log.refined += hypotheses.len();
        if hypotheses.first().is_none_or(|best| best.log_odds < LEAST_LAID) {
            return;
        }
        let laid = |seed: &Hypothesis| {
            Finding::new(lay(self.query, self.map, seed, &Model { sigma: seed.sigma, ..few }), *seed)
        };
        let mut laid: Vec<Finding> = hypotheses.par_iter().map(laid).collect();
        log.grown += laid.len();
        laid.retain(|finding| self.is_pose(finding));
        let least = outlying(self.config.false_alarm_rate, REACHED_LAID);
        let answer = self.single_out(&mut laid, f64::NEG_INFINITY, KEPT.laid, log);
        let Some(answer) = answer.filter(|answer| answer.overlap.log_odds > least) else {
            return;
        };
        let answer = self.laid_again(&answer, &few);
        // Visits to one side are laid along each other by as many nats more as chance may have, and paired worse so.
        let says_more = accepted.iter().all(|found| answer.evidence() > found.evidence() + SELDOM);
        // Rows that lie on each other all along and show few of the fruits that they then should have in common are strangers.
        if says_more && answer.share_of_row() > LEAST_AGAIN {
            accepted.push(answer);
            others.extend(laid);
        }
    }

    /// An answer laid once more, as holding everywhere, under the noise that suits the pull best: the nearest fruits, which it
    /// was found by, are often strangers.
    fn laid_again(&self, found: &Finding, few: &Model) -> Finding<'a> {
        let sigma = soft::sharpest(self.query, self.map, few, &[found.overlap.pose]);
        let seed = Hypothesis { pose: found.overlap.pose, sigma, ..found.seed };
        let mut growth = lay(self.query, self.map, &seed, &Model { sigma, ..*few });
        (growth.whole, growth.sharpest) = (true, Some(sigma));
        let mut again = Finding::new(growth, seed);
        again.overlap.log_odds = again.overlap.log_odds.max(found.overlap.log_odds);
        self.settle(&mut again);
        again
    }
}
