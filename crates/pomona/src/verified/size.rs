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
        (same.1 < 0.8 * other.1).then_some(Self { query, map, same, other })
    }

    /// How much likelier the two diameters are for one fruit than for two.
    pub(crate) fn ratio(&self, query: u32, map: u32) -> f64 {
        let difference = self.map[map as usize] - self.query[query as usize];
        if !difference.is_finite() {
            return 1.0;
        }
        // Tails of a t-distribution: a diameter can be wrong altogether, and then must not forbid the pair.
        let density = |(centre, spread): (f64, f64)| {
            let z = (difference - centre) / spread;
            (1.0 + z * z / TAILS).powf(-(TAILS + 1.0) / 2.0) / spread
        };
        density(self.same) / density(self.other)
    }
}

/// Degrees of freedom of the tails.
const TAILS: f64 = 4.0;

/// Median and 1.48 times the median absolute deviation.
fn centre_and_spread(values: &mut [f64]) -> (f64, f64) {
    let centre = upper_median(values);
    let mut deviations: Vec<f64> = values.iter().map(|x| (x - centre).abs()).collect();
    (centre, (1.4826 * upper_median(&mut deviations)).max(LEAST_SPREAD))
}
