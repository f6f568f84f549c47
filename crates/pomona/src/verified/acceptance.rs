//! When evidence is enough: thresholds as a false-alarm rate.

use crate::error::{Error, Result};
use crate::geometry::Scale;
use crate::meanings::settings;
use serde::{Deserialize, Serialize};

settings! {
/// Settings of the verified method. Lengths are shares of the clouds' own spacing (see the docs page), so that there is
/// nothing to tune to an orchard.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VerifiedConfig {
    /// Probability that two clouds without a common fruit are given an answer.
    pub false_alarm_rate: f64,
    /// Seeds per fruit of the query, the longest of them all, that are tried before the answer is "no match"; twice as
    /// many where the vertical is known. The short rounds before come on top.
    pub seeds_per_fruit: u64,
    /// Least probability of a reported pair, under the pose that is reported; of an ambiguous answer it is divided by the number of poses.
    pub min_probability: f64,
}
}

/// Probability from which on a pair is worth reporting: a wrong one costs a third of what a right one is worth.
pub(super) const WORTH_IT: f64 = 0.25;

impl Default for VerifiedConfig {
    fn default() -> Self {
        Self {
            // Three in ten thousand: a dozen fruits on one tree, at the limit of the evidence, can still be told.
            false_alarm_rate: 3e-4,
            // The longest of some 68 sets each: with one shared tree of five and 45 % hidden, ten true ones are among
            // them.
            seeds_per_fruit: 32,
            min_probability: WORTH_IT,
        }
    }
}

impl VerifiedConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// The setting that is outside its range.
    pub fn validate(&self) -> Result<()> {
        let wrong = |name, reason: &str| Err(Error::Setting { name, reason: reason.to_owned() });
        if !(self.false_alarm_rate > 0.0 && self.false_alarm_rate < 1.0) {
            return wrong("verified.false_alarm_rate", "expected a probability between 0 and 1");
        }
        if self.seeds_per_fruit == 0 {
            return wrong("verified.seeds_per_fruit", "found 0, expected at least 1");
        }
        if !(0.0..=1.0).contains(&self.min_probability) {
            return wrong("verified.min_probability", "expected a probability from 0 to 1");
        }
        Ok(())
    }
}

/// Log-odds, in nats, that the best wrong pose exceeds with a probability of `rate`, where any of `poses` could have been found.
///
/// Were the log-odds of a wrong pose those of a fixed pose, `P(any of N > t) <= N exp(-t)`. Refinement fits six or
/// seven numbers to each and so stretches the tail: over unrelated clouds the largest log-odds follow
/// `P(max > t) = exp(-(t - offset - per_pose ln N) / stretch)`. `python -m benchmarks chance` fits the three; it gives
/// 16.0, 0.56 and 1.8 for crowns: as much for a dozen fruits and less for rows. The cells without overlap and the
/// unrelated clouds of the benchmarks `cells` and `season` hold them to account.
///
/// Where only a `share` of all turns is admitted, the probability is that share of it.
pub(crate) fn reached(rate: f64, poses: f64, share: f64) -> f64 {
    let [offset, per_pose, stretch] = LARGEST;
    offset + per_pose * poses.max(1.0).ln() + stretch * (share.ln() - rate.ln())
}

/// Shares of the evidence needed that a pose must have: once it is settled, every fruit predicted without its own partner, and in
/// pairs that are believed.
pub(super) struct Kept {
    /// Where the threshold is what chance reaches anywhere.
    pub(super) threshold: [f64; 2],
    /// Where a pose stands out of all others: what true poses keep. Poses on wires that have far more than all others
    /// keep 0.5 to 0.75.
    pub(super) outlier: [f64; 2],
    /// The same of rows laid along rows, whose fruits in common are few: true poses keep 0.5 to 0.9. Wrong ones on wires may keep
    /// as much; what these lack is the share of the row.
    pub(super) laid: [f64; 2],
}

pub(super) const KEPT: Kept = Kept { threshold: [0.8, 0.9], outlier: [0.9; 2], laid: [0.6; 2] };

/// Rate of the log-odds from which on a wrong pose shows a pattern of the planting: chance alone gives as much to one query
/// in twenty.
pub(super) const PATTERN: f64 = 0.05;

/// Times as many deviations as wrong poses reach, by which an answer has more evidence than it has moved and that other poses have much, too,
/// is no doubt: true ones among trees of one clone have 3 to 8 times as many, on walls of single fruits 1.4 to 2.3, wrong ones on these and on
/// fans of equal trees up to 1.7. Along a line as much is asked of every answer that is not sure: true ones have 2.2 to 11 times as many,
/// wrong ones up to 1.2.
pub(super) const CLEAR_OF_PATTERNS: f64 = 2.0;

/// A pose with this many times the evidence needed is no local optimum, no pattern of the planting and no mirror image.
pub(super) const SURE: f64 = 6.0;

/// Log-odds, in nats, that the best of many wrong poses exceeds with a probability of `rate` where the second best has
/// `second`.
///
/// The largest of many values with an exponential tail exceeds the second largest by x with probability
/// `exp(-x / SPACING)`, however many there are and wherever they lie (Renyi 1953).
pub(crate) fn outlying(rate: f64, second: f64) -> f64 {
    second - SPACING * rate.ln()
}

/// Poses that two clouds offer: any fruit on any fruit; where the scale is free, at any of a hundred scales.
pub(crate) fn poses(n_query: usize, n_map: usize, scale: Scale) -> f64 {
    let scales = match scale {
        Scale::Metric => 1.0,
        Scale::Free => 100.0,
    };
    n_query as f64 * n_map as f64 * scales
}

/// The law of the largest log-odds of wrong poses: what a single one reaches, in nats; how they grow with the
/// logarithm of the poses, from a dozen fruits to rows of five trees; and how much slower than exp(-t) the tail of
/// refined ones falls.
const LARGEST: [f64; 3] = [5.1, 2.5, 1.77];

/// Mean distance, in nats, from the best wrong pose of a search to the second best: of 460 pairs of unrelated clouds, from
/// frames of 16 fruits to rows, a tenth lie more than 4.7 apart, one in a hundred 7.6.
const SPACING: f64 = 2.1;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenth_of_the_rate_asks_for_as_much_more_wherever_the_second_lies() {
        let more = |second| outlying(1e-3, second) - outlying(1e-2, second);
        assert!((more(20.0) - SPACING * 10f64.ln()).abs() < 1e-9 && (more(20.0) - more(60.0)).abs() < 1e-9);
        assert!((outlying(1.0, 20.0) - 20.0).abs() < 1e-12);
    }

    #[test]
    fn more_poses_and_fewer_false_alarms_ask_for_more() {
        assert!(reached(1e-4, 1e5, 1.0) > reached(1e-4, 1e3, 1.0));
        assert!(reached(1e-4, 1e3, 0.01) < reached(1e-4, 1e3, 1.0));
        assert!(reached(1e-6, 1e3, 1.0) > reached(1e-4, 1e3, 1.0));
    }

    #[test]
    fn settings_outside_their_range_are_named() {
        let wrong = VerifiedConfig { false_alarm_rate: 0.0, ..VerifiedConfig::default() };
        assert!(wrong.validate().expect_err("zero is no rate").to_string().contains("false_alarm_rate"));
    }
}
