//! The noise, from distances alone.
//!
//! Lay one visit on the other and count, for every fruit, the fruits of the other visit by their distance. Two things
//! are counted: the fruit itself, where it was seen again, at the distance that the noise gives; and its companions,
//! which hang as each visit shows them around its own fruits. The second is known, so the first is what is left:
//!
//! `H(d) = u (p f(d; sigma) + b g(d))`, f the distribution of the lengths of noise (Maxwell's where it is a sphere), g the
//! companions of a fruit, u the fruits that the other visit could have shown. Where a tree was replaced nothing was seen again, and what
//! hangs there keeps no distance from what hung there; as far as that is known it does not count. Nobody has to say who is who. Estimates from
//! pairs do, and take the nearest for the true one where fruits crowd, so that the noise comes out small.

use super::chance::{BIN, shell};
use super::hypothesis::SHARES;
use super::patches::Patchwork;
use crate::neighbours::others::SHARE_OF_ROWS;
use crate::neighbours::tree::single;
use crate::statistics::length_within;
use rayon::prelude::*;

/// What is known of the noise beforehand.
#[derive(Debug, Clone, Copy)]
pub(super) struct KnownNoise {
    /// Metres of the map.
    pub(super) sigma: f64,
    /// Standard deviation of its logarithm.
    pub(super) width: f64,
}

/// Width of a noise that is guessed by the spacing, within a factor of two; and of one that the caller gives or the pull of all
/// fruits, within a tenth, for sag that is not followed adds to it.
pub(super) const GUESSED: f64 = 0.7;
pub(super) const GIVEN: f64 = 0.1;

/// Counts by distance: across the visits, and what companions alone would give.
struct Counts {
    bin: f64,
    across: [f64; BINS],
    companions: [f64; BINS],
    due: f64,
    /// How surely the map would show one that it would show, in the mean.
    usual: f64,
    /// Of the noise along its axes, over their mean.
    variances: [f64; 3],
}

/// Up to 1.25 spacings.
const BINS: usize = 30;

/// Companions are as dense across the visits as within, where the map shows as much as is usual, as if this many had been
/// counted so.
const STEADY: f64 = 200.0;

/// Rounds of expectation and maximisation of the share.
const ROUNDS: usize = 20;

/// What distances say of an overlap.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scatter {
    /// Noise under the predictions: standard deviation per axis of the distance to the partner, metres of the map.
    pub(super) sigma: f64,
    /// Companions across the visits, over those within them: b.
    pub(super) strangers: f64,
}

/// Noise and companions under the predictions.
pub(super) fn scatter(laid: &Patchwork, expected: KnownNoise) -> Scatter {
    let counts = Counts::new(laid);
    // Each an eighth of an octave above the last: from half a bin to half of all, 5 mm to 16 cm in an orchard.
    let sigmas: Vec<f64> = (0..8 * BINS as i32)
        .map(|step| 0.5 * counts.bin * 2f64.powf(f64::from(step) / 8.0))
        .take_while(|&sigma| sigma < 0.5 * counts.bin * BINS as f64)
        .collect();
    let weigh = |&sigma: &f64| {
        let off = (sigma / expected.sigma).ln() / expected.width;
        // Cauchy's prior lets go of a noise that the counts contradict; a normal one would not.
        let (likelihood, density) = counts.likelihood(sigma);
        (likelihood - (off * off).ln_1p(), sigma, density)
    };
    let tried: Vec<(f64, f64, f64)> = sigmas.par_iter().with_min_len(sigmas.len().div_ceil(8)).map(weigh).collect();
    let best = tried.iter().fold(f64::NEG_INFINITY, |best, tried| best.max(tried.0));
    let [mut total, mut logarithm, mut dense] = [0.0; 3];
    for (likelihood, sigma, density) in tried {
        let weight = (likelihood - best).exp();
        total += weight;
        logarithm += weight * sigma.ln();
        dense += weight * density;
    }
    Scatter { sigma: (logarithm / total).exp(), strangers: dense / total }
}

impl Counts {
    fn new(laid: &Patchwork) -> Self {
        let Patchwork { query, map, predictions, .. } = laid;
        let bin = BIN * map.spacing;
        let part = |first: usize| {
            let (mut across, mut due) = ([0.0; BINS], [0.0; 3]);
            for (row, at) in predictions.iter().enumerate().skip(first).take(SHARE_OF_ROWS) {
                let Some(at) = at else { continue };
                let support = laid.shown(row, &at.place);
                let stands = 1.0 - laid.replaced[row];
                let more = [1.0, support, stands].map(|times| stands * support * times);
                due.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
                map.tree.within(&single(&at.place), (BINS as f64 * bin) as f32, |_, d2| {
                    if let Some(count) = across.get_mut((f64::from(d2).sqrt() / bin) as usize) {
                        *count += stands;
                    }
                });
            }
            (across, due)
        };
        let parts: Vec<([f64; BINS], [f64; 3])> =
            (0..query.len()).into_par_iter().step_by(SHARE_OF_ROWS).map(part).collect();
        let across = std::array::from_fn(|i| parts.iter().map(|part| part.0[i]).sum());
        let [due, squares, stand] = [0, 1, 2].map(|power: usize| parts.iter().map(|part| part.1[power]).sum::<f64>());
        let [same, another] = laid.companions();
        let companions = std::array::from_fn(|i| {
            let (inner, outer) = (i as f64 * bin, (i + 1) as f64 * bin);
            let around = stand * same.between(inner, outer) + (due - stand) * another.between(inner, outer);
            around.max(due * map.floor * shell(inner, outer))
        });
        let usual = if due > 0.0 { squares / due } else { 1.0 };
        Self { bin, across, companions, due, usual, variances: laid.direction.variances() }
    }

    /// Log-likelihood of the counts under the noise, with the share that suits it; and the density of companions that does.
    fn likelihood(&self, sigma: f64) -> (f64, f64) {
        let cumulative: [f64; BINS + 1] =
            std::array::from_fn(|i| length_within(i as f64 * self.bin / sigma, &self.variances));
        let bins = || {
            let found = cumulative.windows(2).map(|ends| self.due * (ends[1] - ends[0]));
            self.across.iter().zip(&self.companions).zip(found)
        };
        let companions: f64 = self.companions.iter().sum();
        let (mut share, mut density) = (0.5, 1.0);
        for _ in 0..ROUNDS {
            let (mut own, mut other) = (0.0, 0.0);
            for ((count, companions), found) in bins() {
                let (a, b) = (share * found, density * companions);
                own += count * a / (a + b);
                other += count * b / (a + b);
            }
            share = (own + 1.0) / (self.due + 2.0);
            density = (other + STEADY) / (companions + STEADY * self.usual);
        }
        let share = share.clamp(SHARES.0, SHARES.1);
        let likelihoods = bins().map(|((count, companions), found)| {
            let mean = share * found + density * companions;
            count * mean.ln() - mean
        });
        let prior = share.ln() + (1.0 - share).ln() + STEADY * (density.ln() - self.usual * density);
        (likelihoods.sum::<f64>() + prior, density)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Scale, Similarity};
    use crate::verified::direction::Direction;
    use crate::verified::fixture::visits_of;
    use crate::verified::hypothesis::{DETECTION, Model};
    use crate::verified::landscape::Landscape;
    use crate::verified::patches::Landing;
    use nalgebra::{Matrix3, Vector3};

    /// Noise of visits that lie on each other, as it is found where so much was told and it is expected to point somewhere.
    fn found(noise: [f64; 3], told: KnownNoise, direction: Direction) -> f64 {
        let (query, map) = visits_of(&Vector3::from(noise));
        let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
        let place = |p: &Vector3<f64>| Some(Landing { place: p + query.centre - map.centre, variance: 1.0 });
        let model = Model { sigma: told.sigma, detection: DETECTION, scale: Scale::Metric, vertical: None, row: None };
        let mut laid = Patchwork::new(&query, &map, Similarity::identity(), told.sigma, &model);
        laid.predictions = query.points.iter().map(place).collect();
        laid.direction = direction;
        scatter(&laid, told).sigma
    }

    #[test]
    fn noise_is_told_where_the_nearest_is_often_a_stranger() {
        for sigma in [0.01, 0.02, 0.04] {
            // A guess, and what a caller says and is wrong by a factor of two.
            for (told, width, off) in [(0.02, GUESSED, 0.12), (0.5 * sigma, GIVEN, 0.15), (2.0 * sigma, GIVEN, 0.15)] {
                let found = found([sigma; 3], KnownNoise { sigma: told, width }, Direction::default());
                assert!((found / sigma - 1.0).abs() < off, "{found} for {sigma}, told {told}");
            }
        }
    }

    #[test]
    fn noise_that_is_long_one_way_is_told_where_the_way_is_known() {
        let guess = KnownNoise { sigma: 0.02, width: GUESSED };
        let [round, long] = [Direction::default(), Direction::long_in_depth(&Matrix3::identity())]
            .map(|direction| found([0.015, 0.015, 0.03], guess, direction));
        let mean = (2.0f64 * 0.015 * 0.015 + 0.03 * 0.03).sqrt() / 3f64.sqrt();
        assert!((long / mean - 1.0).abs() < 0.1, "{long} for {mean}");
        assert!((long / mean).ln().abs() < (round / mean).ln().abs(), "{long} {round} for {mean}");
    }
}
