//! Diameters as a soft cue, once the growth that all fruits share is removed.

use super::landscape::Landscape;
use crate::beliefs::Edge;
use crate::statistics::upper_median;

/// Pairs needed before diameters are believed: growth and its spread are two numbers.
const MIN_PAIRS: usize = 6;

/// Relative size differences never count as more precise than this: 1 mm on an apple.
const LEAST_SPREAD: f64 = 0.015;

/// The cue fitted to a first set of pairs.
pub(crate) struct Cue<'a> {
    /// Logarithms of the diameters.
    query: &'a [f64],
    map: &'a [f64],
    /// Median and spread of ln(map / query) over fruits that are the same.
    same: (f64, f64),
    /// The same over fruits that are not.
    other: (f64, f64),
    /// Of the fruits that are the same: those that grow slower, as they are about to drop.
    share_slow: f64,
}

impl<'a> Cue<'a> {
    /// Learns growth and spread from probable pairs; `None` where too few have diameters or they tell nothing.
    pub(crate) fn new([query, map]: [&'a Landscape; 2], links: impl Iterator<Item = (&'a Edge, f64)>) -> Option<Self> {
        let (query, map) = (query.log_diameters.as_deref()?, map.log_diameters.as_deref()?);
        let mut differences: Vec<f64> = links
            .filter(|(_, probability)| *probability > 0.5)
            .map(|(edge, _)| map[edge.map as usize] - query[edge.query as usize])
            .filter(|difference| difference.is_finite())
            .collect();
        if differences.len() < MIN_PAIRS {
            return None;
        }
        let same = centre_and_spread(&mut differences);
        let known = |sizes: &[f64]| sizes.iter().copied().filter(|x| x.is_finite()).collect::<Vec<f64>>();
        let [of_query, of_map] = [query, map].map(|sizes| centre_and_spread(&mut known(sizes)));
        let other = (of_map.0 - of_query.0, of_query.1.hypot(of_map.1));
        let share_slow = share_slow(&differences, same, other);
        (same.1 < 0.8 * other.1).then_some(Self { query, map, same, other, share_slow })
    }

    /// How much likelier the two diameters are for one fruit than for two.
    pub(crate) fn ratio(&self, query: u32, map: u32) -> f64 {
        let difference = self.map[map as usize] - self.query[query as usize];
        if !difference.is_finite() {
            return 1.0;
        }
        let one = (1.0 - self.share_slow) * density(difference, self.same)
            + self.share_slow * density_of_slow(difference, self.same);
        one / density(difference, self.other)
    }
}

/// Fruits that are not slow, and are counted beside those that were seen: so that one or two odd sizes make no share.
const NOT_SLOW: f64 = 4.0;

/// Rounds of expectation-maximisation: from a tenth each they move by less than a hundredth afterwards.
const ROUNDS: usize = 30;

/// Learns which share of the pairs grew slower, beside those that grew as all do and those that are no pairs.
fn share_slow(differences: &[f64], same: (f64, f64), other: (f64, f64)) -> f64 {
    let (mut slow, mut wrong) = (0.1, 0.1);
    for _ in 0..ROUNDS {
        let (mut slow_sum, mut wrong_sum) = (0.0, 0.0);
        for &difference in differences {
            let of_slow = slow * density_of_slow(difference, same);
            let of_wrong = wrong * density(difference, other);
            let of_all = of_slow + of_wrong + (1.0 - slow - wrong) * density(difference, same);
            slow_sum += of_slow / of_all;
            wrong_sum += of_wrong / of_all;
        }
        let n = differences.len() as f64 + NOT_SLOW;
        (slow, wrong) = (slow_sum / n, wrong_sum / n);
    }
    slow / (1.0 - wrong)
}

/// Of fruits that grow slower the growth is anything from none to that of the others, level. 0 where there is none.
fn density_of_slow(difference: f64, (growth, spread): (f64, f64)) -> f64 {
    if growth.abs() <= spread {
        return 0.0;
    }
    (below(difference / spread) - below((difference - growth) / spread)).abs() / growth.abs()
}

/// Student's density with four degrees of freedom: a diameter can be wrong altogether, and then must not forbid the pair.
fn density(difference: f64, (centre, spread): (f64, f64)) -> f64 {
    let z = (difference - centre) / spread;
    0.375 * (1.0 + z * z / 4.0).powf(-2.5) / spread
}

/// Student's probability below `z`, four degrees of freedom.
fn below(z: f64) -> f64 {
    let square = 1.0 + z * z / 4.0;
    0.5 + 0.375 * z / square.sqrt() * (1.0 - z * z / square / 12.0)
}

/// Median and 1.48 times the median absolute deviation.
fn centre_and_spread(values: &mut [f64]) -> (f64, f64) {
    let centre = upper_median(values);
    let mut deviations: Vec<f64> = values.iter().map(|x| (x - centre).abs()).collect();
    (centre, (1.4826 * upper_median(&mut deviations)).max(LEAST_SPREAD))
}

#[cfg(test)]
mod tests {
    use super::{Cue, below, density, share_slow};

    #[test]
    fn the_probability_below_is_the_integral_of_the_density() {
        for z in [-6.0, -1.5, 0.0, 0.4, 3.0] {
            let slope = (below(z + 1e-4) - below(z - 1e-4)) / 2e-4;
            assert!((slope - density(z, (0.0, 1.0))).abs() < 1e-7);
        }
        assert!(below(-1e3) < 1e-6 && below(1e3) > 1.0 - 1e-6);
    }

    #[test]
    fn a_fruit_that_all_but_stands_still_may_be_the_same_and_one_that_shrank_is_not() {
        let (query, map) = ([0.0; 4], [0.36, 0.05, -0.30, 0.72]);
        let (same, other) = ((0.36, 0.04), (0.36, 0.17));
        let of = |share_slow| {
            let cue = Cue { query: &query, map: &map, same, other, share_slow };
            [0, 1, 2, 3].map(|fruit| cue.ratio(fruit, fruit))
        };
        let [as_all, slow, shrunk, faster] = of(0.2);
        assert!(as_all > 3.0 && slow > 0.5, "{as_all} {slow}");
        assert!(shrunk < 0.2 && faster < 0.2, "{shrunk} {faster}");
        assert!(of(0.0)[1] < 0.2);
    }

    #[test]
    fn the_share_that_is_slow_is_learned_and_is_none_where_pairs_are_wrong_on_both_sides() {
        let (same, other) = ((0.36, 0.04), (0.36, 0.17));
        let grown = (0..80).map(|number| 0.36 + 0.0015 * (f64::from(number) - 39.5));
        let slow = (0..20).map(|number| 0.012 * f64::from(number));
        let wrong = (0..20).map(|number| 0.36 + 0.03 * (f64::from(number) - 9.5));
        let with_slow: Vec<f64> = grown.clone().chain(slow).collect();
        let with_wrong: Vec<f64> = grown.clone().chain(wrong).collect();
        let share = share_slow(&with_slow, same, other);
        assert!((0.1..0.25).contains(&share), "{share}");
        assert!(share_slow(&with_wrong, same, other) < 0.08);
        assert!(share_slow(&grown.collect::<Vec<f64>>(), same, other) < 0.02);
        // Sizes that differ by a scale alone say nothing of growth.
        assert!(share_slow(&[0.02; 20], (0.02, 0.04), other) < 1e-9);
    }
}
