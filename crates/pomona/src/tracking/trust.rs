//! How often the depth of a box is the fruit's, learned while tracking.
//!
//! A depth camera is wrong about one fruit in a hundred, where a leaf covers it; stereo may be wrong about every second. What
//! fruits known from several places say about the depths of their boxes is counted, by the support that a depth had.

use super::config::TrackingConfig;

/// Classes of support; more would not fill.
const CLASSES: usize = 5;

/// Sightings that what is assumed at the start is worth, in each class.
const ASSUMED: f64 = 20.0;

/// Of wrong depths, those that are nearer than the fruit, at the start: of the rendered row's exact depths all but one of
/// twelve are a leaf's, for nothing is seen through an apple.
const NEARER: f64 = 0.9;

/// Probabilities of what a depth is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Trust {
    pub fits: f64,
    pub nearer: f64,
    pub farther: f64,
}

impl Trust {
    /// Density of a wrong depth: nearer ones anywhere between camera and fruit, farther ones evenly in 1 / Z.
    pub fn wrong_density(&self, z: f64, fruit_z: f64) -> f64 {
        if z < fruit_z { self.nearer / fruit_z } else { self.farther * fruit_z / (z * z) }
    }
}

/// Counts by support.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reliability {
    counts: [[f64; 3]; CLASSES],
}

impl Reliability {
    pub fn new(config: &TrackingConfig) -> Self {
        let wrong = config.depth_outliers;
        let assumed = [1.0 - wrong, wrong * NEARER, wrong * (1.0 - NEARER)];
        Self { counts: [assumed.map(|part| part * ASSUMED); CLASSES] }
    }

    pub fn trust(&self, support: f64) -> Trust {
        let counts = self.counts[class(support)];
        let total: f64 = counts.iter().sum();
        let [fits, nearer, farther] = counts.map(|count| count / total);
        Trust { fits, nearer, farther }
    }

    /// Notes a depth that fits a known fruit with the probability `fits`, or else is nearer or farther.
    pub fn learn(&mut self, support: f64, fits: f64, is_nearer: bool) {
        let counts = &mut self.counts[class(support)];
        counts[0] += fits;
        counts[if is_nearer { 1 } else { 2 }] += 1.0 - fits;
    }
}

fn class(support: f64) -> usize {
    ((support * CLASSES as f64) as usize).min(CLASSES - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_learned_outweighs_what_was_assumed() {
        let mut reliability = Reliability::new(&TrackingConfig::default());
        for _ in 0..500 {
            reliability.learn(0.9, 1.0, true);
            reliability.learn(0.1, 0.0, false);
        }
        assert!(reliability.trust(1.0).fits > 0.98);
        let poor = reliability.trust(0.0);
        assert!(poor.fits < 0.05 && poor.farther > 0.9);
        assert!((poor.fits + poor.nearer + poor.farther - 1.0).abs() < 1e-12);
    }

    #[test]
    fn densities_of_wrong_depths_integrate_to_their_part() {
        let trust = Trust { fits: 0.7, nearer: 0.2, farther: 0.1 };
        let step = 1e-3;
        let total: f64 = (1..200_000).map(|k| trust.wrong_density(f64::from(k) * step, 1.5) * step).sum();
        assert!((total - 0.3).abs() < 2e-3, "{total}");
    }
}
