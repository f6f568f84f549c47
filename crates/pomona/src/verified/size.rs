//! Diameters as a soft cue, once the growth that all fruits share is removed.

use super::landscape::{Landscape, median};
use super::pairing::Link;
use crate::cloud::FruitCloud;

/// Pairs needed before diameters are believed: growth and its spread are two numbers.
const MIN_PAIRS: usize = 6;

/// Relative size differences never count as more precise than this: 1 mm on an apple.
const LEAST_SPREAD: f64 = 0.015;

/// Logarithms of the diameters in the order of the landscapes; NaN where unknown.
pub(crate) struct Diameters {
    query: Vec<f64>,
    map: Vec<f64>,
}

/// The cue fitted to a first set of pairs.
pub(crate) struct Cue<'a> {
    sizes: &'a Diameters,
    /// Median and spread of ln(map / query) over fruits that are the same.
    same: (f64, f64),
    /// The same over fruits that are not.
    other: (f64, f64),
}

impl Diameters {
    /// `None` unless both clouds have diameters.
    pub(crate) fn new(query: &FruitCloud, map: &FruitCloud, q: &Landscape, m: &Landscape) -> Option<Self> {
        let logarithms = |cloud: &FruitCloud, landscape: &Landscape| {
            let diameters = cloud.diameters_m.as_ref()?;
            Some(landscape.rows.iter().map(|&row| diameters[row as usize].ln()).collect::<Vec<f64>>())
        };
        Some(Self { query: logarithms(query, q)?, map: logarithms(map, m)? })
    }

    /// Learns growth and spread from probable pairs; `None` where too few have diameters or they tell nothing.
    pub(crate) fn cue(&self, links: impl Iterator<Item = Link>) -> Option<Cue<'_>> {
        let mut differences: Vec<f64> = links
            .filter(|link| link.probability > 0.5)
            .map(|link| self.map[link.map as usize] - self.query[link.query as usize])
            .filter(|difference| difference.is_finite())
            .collect();
        if differences.len() < MIN_PAIRS {
            return None;
        }
        let same = centre_and_spread(&mut differences);
        let mut query: Vec<f64> = self.query.iter().copied().filter(|x| x.is_finite()).collect();
        let mut map: Vec<f64> = self.map.iter().copied().filter(|x| x.is_finite()).collect();
        let (query, map) = (centre_and_spread(&mut query), centre_and_spread(&mut map));
        let other = (map.0 - query.0, query.1.hypot(map.1));
        (same.1 < 0.8 * other.1).then_some(Cue { sizes: self, same, other })
    }
}

impl Cue<'_> {
    /// How much likelier the two diameters are for one fruit than for two.
    pub(crate) fn ratio(&self, query: u32, map: u32) -> f64 {
        let difference = self.sizes.map[map as usize] - self.sizes.query[query as usize];
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
    let centre = median(values);
    let mut deviations: Vec<f64> = values.iter().map(|x| (x - centre).abs()).collect();
    (centre, (1.4826 * median(&mut deviations)).max(LEAST_SPREAD))
}
