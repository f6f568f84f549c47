//! Fruits of one picture are about one size: what the sure ones say of the others.
//!
//! An outline and a disparity make a diameter, D = 2 (R/Z) f B / d. A leaf in front of the fruit would make it too small, the
//! row behind too large. The diameters of the surely matched fruits have a median and a spread, in logarithms, and every
//! disparity of another fruit costs by how far it is from them. The cost grows as the logarithm of a Cauchy density does: a
//! clear match overrules it, a fruit of another size is believed.

use crate::statistics::median;

/// Least number of sure matches that speak for the others.
const MIN_SURE: usize = 4;

/// Least spread of log diameters: fruits of one tree, and outlines that leaves make smaller.
const MIN_SPREAD: f64 = 0.1;

/// What leaves take from the outlines of fruits that cannot be matched, over the diameter: with it the spread is the
/// 15 % that those of the rendered row have.
const HIDDEN_SPREAD: f64 = 0.1;

/// What one more e-fold of improbability costs, over the median cost of a disc.
const WEIGHT: f64 = 0.2;

/// Median and spread of the logarithm of diameters.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sizes {
    centre: f64,
    spread: f64,
}

impl Sizes {
    /// None where too few are sure.
    pub(crate) fn of(diameters_m: impl Iterator<Item = f64>) -> Option<Self> {
        let mut logs: Vec<f64> = diameters_m.map(f64::ln).collect();
        if logs.len() < MIN_SURE {
            return None;
        }
        let centre = median(&mut logs);
        let mut off: Vec<f64> = logs.iter().map(|one| (one - centre).abs()).collect();
        Some(Self { centre, spread: (1.4826 * median(&mut off)).hypot(MIN_SPREAD) })
    }

    /// The usual diameter, and by what part of itself the diameter that an outline shows differs from it.
    pub(crate) fn usual(&self) -> (f64, f64) {
        (self.centre.exp(), self.spread.hypot(HIDDEN_SPREAD))
    }

    /// What a diameter costs.
    pub(crate) fn cost(&self, diameter_m: f64) -> f64 {
        let off = (diameter_m.ln() - self.centre) / self.spread;
        WEIGHT * (0.5 * off * off).ln_1p()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_size_costs_nothing_and_any_size_a_bounded_slope() {
        let sizes = Sizes::of([0.07, 0.072, 0.068, 0.071, 0.2].into_iter()).expect("five are enough");
        assert!(sizes.cost(0.071) < 1e-9);
        assert!(sizes.cost(0.05) > 0.1 && sizes.cost(0.1) > 0.1);
        // Ten times as far in logarithms costs far less than ten times as much.
        assert!(sizes.cost(0.071 * 8.0) < 4.0 * sizes.cost(0.071 * 1.5));
        assert!(Sizes::of([0.07, 0.07, 0.07].into_iter()).is_none());
    }
}
