//! The noise, from distances alone.
//!
//! Lay one visit on the other and count, for every fruit, the fruits of the other visit by their distance. Two things
//! are counted: the fruit itself, where it was seen again, at the distance that the noise gives; and its companions,
//! which hang as each visit shows them around its own fruits. The second is known, so the first is what is left:
//!
//! `H(d) = u (p f(d; sigma) + b g(d))`, f Maxwell's distribution, g the companions of a fruit, u the fruits that the
//! other visit could have shown. Nobody has to say who is who. Estimates from pairs do, and take the nearest for the
//! true one where fruits crowd, so that the noise comes out small.

use super::hypothesis::SHARES;
use super::landscape::Landscape;
use super::nearest::{SHARE_OF_ROWS, single};
use super::pairing::Laid;
use super::placement::Landing;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// What is known of the noise beforehand.
#[derive(Debug, Clone, Copy)]
pub(super) struct KnownNoise {
    /// Metres of the map.
    pub(super) sigma: f64,
    /// Standard deviation of its logarithm.
    pub(super) width: f64,
}

/// Width of a noise that is guessed by the spacing, within a factor of two; and of one that the caller or the outline gives,
/// within a tenth, for sag that is not followed adds to it.
pub(super) const GUESSED: f64 = 0.7;
pub(super) const GIVEN: f64 = 0.1;

/// Counts by distance: across the visits, and what companions alone would give.
struct Counts {
    bin: f64,
    across: [f64; BINS],
    companions: [f64; BINS],
    due: f64,
}

const BINS: usize = 30;

/// Width of a bin in spacings: 1.1 cm in an orchard; counted up to 1.25 spacings.
const BIN: f64 = 1.0 / 24.0;

/// Companions are as dense across the visits as within, as if this many had been counted so.
const STEADY: f64 = 200.0;

/// Noise in spacings that is tried, from 5 mm to 14 cm in an orchard.
const FINEST: f64 = 0.02;
const STEPS: usize = 40;
const STEP: f64 = 1.085;

/// Rounds of expectation and maximisation of the share.
const ROUNDS: usize = 20;

/// Noise under the predictions: standard deviation per axis of the distance to the partner, metres of the map.
pub(super) fn scatter(laid: &Laid, expected: KnownNoise) -> f64 {
    let counts = Counts::new(laid);
    let finest = FINEST * laid.map.spacing;
    let tried: Vec<(f64, f64)> = (0..STEPS)
        .map(|step| {
            let sigma = finest * STEP.powi(step as i32);
            let off = (sigma / expected.sigma).ln() / expected.width;
            // Cauchy's prior lets go of a noise that the counts contradict; a normal one would not.
            (counts.likelihood(sigma) - (off * off).ln_1p(), sigma)
        })
        .collect();
    let best = tried.iter().fold(f64::NEG_INFINITY, |best, tried| best.max(tried.0));
    let (mut total, mut logarithm) = (0.0, 0.0);
    for (likelihood, sigma) in tried {
        let weight = (likelihood - best).exp();
        total += weight;
        logarithm += weight * sigma.ln();
    }
    (logarithm / total).exp()
}

/// What some of the fruits count.
#[derive(Default)]
struct Part {
    across: [f64; BINS],
    /// Companions of the fruits.
    own: [f64; BINS],
    fruits: f64,
    due: f64,
}

impl Part {
    fn add(mut self, other: &Self) -> Self {
        for (sum, more) in self.across.iter_mut().zip(&other.across).chain(self.own.iter_mut().zip(&other.own)) {
            *sum += more;
        }
        self.fruits += other.fruits;
        self.due += other.due;
        self
    }

    /// Companions of a fruit, by distance.
    fn per_fruit(&self) -> [f64; BINS] {
        self.own.map(|sum| sum / self.fruits.max(1.0))
    }
}

impl Counts {
    fn new(&Laid { query, map, predictions, pose }: &Laid) -> Self {
        let bin = BIN * map.spacing;
        let met: Vec<AtomicBool> = (0..map.len()).map(|_| AtomicBool::new(false)).collect();
        let here = in_parts(query.len(), |row, part| {
            let Some(Landing { place, .. }) = &predictions[row] else { return };
            part.fruits += 1.0;
            part.due += map.support(place);
            map.tree.within(&single(place), (BINS as f64 * bin) as f32, |partner, d2| {
                met[partner as usize].store(true, Ordering::Relaxed);
                add(&mut part.across, f64::from(d2).sqrt() / bin);
            });
            count_companions(query, row, pose.scale / bin, &mut part.own);
        });
        let there = in_parts(map.len(), |row, part| {
            if met[row].load(Ordering::Relaxed) {
                part.fruits += 1.0;
                count_companions(map, row, 1.0 / bin, &mut part.own);
            }
        });
        let mut companions = here.per_fruit();
        for (sum, there) in companions.iter_mut().zip(there.per_fruit()) {
            *sum = here.due * 0.5 * (*sum + there) + LEAST;
        }
        Self { bin, across: here.across, companions, due: here.due }
    }

    /// Log-likelihood of the counts under the noise, with the share that suits it.
    fn likelihood(&self, sigma: f64) -> f64 {
        let cumulative: Vec<f64> = (0..=BINS).map(|i| maxwell(i as f64 * self.bin / sigma)).collect();
        let found: Vec<f64> = cumulative.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let companions: f64 = self.companions.iter().sum();
        let (mut share, mut density) = (0.5, 1.0);
        for _ in 0..ROUNDS {
            let (mut own, mut other) = (0.0, 0.0);
            for ((&count, &found), &companions) in self.across.iter().zip(&found).zip(&self.companions) {
                let (a, b) = (share * self.due * found, density * companions);
                own += count * a / (a + b);
                other += count * b / (a + b);
            }
            share = (own + 1.0) / (self.due + 2.0);
            density = (other + STEADY) / (companions + STEADY);
        }
        let share = share.clamp(SHARES.0, SHARES.1);
        let likelihood: f64 = self
            .across
            .iter()
            .zip(&found)
            .zip(&self.companions)
            .map(|((&count, &found), &companions)| {
                let mean = share * self.due * found + density * companions;
                count * mean.ln() - mean
            })
            .sum();
        let prior = share.ln() + (1.0 - share).ln() + STEADY * (density.ln() - density);
        likelihood + prior
    }
}

/// Companions in a bin at the least, so that no distance is impossible.
const LEAST: f64 = 0.1;

/// What all rows count, the parts summed in the order of the rows.
fn in_parts(rows: usize, count: impl Fn(usize, &mut Part) + Sync) -> Part {
    let part = |first: usize| {
        let mut part = Part::default();
        (first..rows.min(first + SHARE_OF_ROWS)).for_each(|row| count(row, &mut part));
        part
    };
    let parts: Vec<Part> = (0..rows).into_par_iter().step_by(SHARE_OF_ROWS).map(part).collect();
    parts.iter().fold(Part::default(), Part::add)
}

fn add(bins: &mut [f64; BINS], place: f64) {
    if let Some(bin) = bins.get_mut(place as usize) {
        *bin += 1.0;
    }
}

fn count_companions(cloud: &Landscape, row: usize, bins_per_metre: f64, bins: &mut [f64; BINS]) {
    for &other in cloud.neighbours(row) {
        add(bins, (cloud.points[other as usize] - cloud.points[row]).norm() * bins_per_metre);
    }
}

/// Distribution of the length of a vector of three standard normal numbers.
fn maxwell(x: f64) -> f64 {
    erf(x / std::f64::consts::SQRT_2) - (2.0 / std::f64::consts::PI).sqrt() * x * (-0.5 * x * x).exp()
}

/// Error function of x >= 0 to 1.5e-7 (Abramowitz and Stegun 7.1.26).
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let polynomial =
        ((((1.061_405_429 * t - 1.453_152_027) * t + 1.421_413_741) * t - 0.284_496_736) * t + 0.254_829_592) * t;
    1.0 - polynomial * (-x * x).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verified::fixture::visits;
    use crate::verified::placement::Placement;
    use nalgebra::Vector3;

    #[test]
    fn noise_is_told_where_the_nearest_is_often_a_stranger() {
        for sigma in [0.01, 0.02, 0.04] {
            let (query, map) = visits(sigma);
            let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
            let place = |p: &Vector3<f64>| Some(Landing { place: p + query.centre - map.centre, variance: 1.0 });
            let predictions: Vec<_> = query.points.iter().map(place).collect();
            let laid = Laid { query: &query, map: &map, predictions: &predictions, pose: &Placement::identity() };
            // A guess, and what a caller says and is wrong by a factor of two.
            for (told, width, off) in [(0.02, GUESSED, 0.12), (0.5 * sigma, GIVEN, 0.15), (2.0 * sigma, GIVEN, 0.15)] {
                let found = scatter(&laid, KnownNoise { sigma: told, width });
                assert!((found / sigma - 1.0).abs() < off, "{found} for {sigma}, told {told}");
            }
        }
    }

    #[test]
    fn the_distribution_of_lengths_is_that_of_maxwell() {
        assert!(maxwell(0.0).abs() < 1e-6);
        assert!((maxwell(1.538_17) - 0.5).abs() < 1e-4); // its median
        assert!((maxwell(6.0) - 1.0).abs() < 1e-6);
    }
}
