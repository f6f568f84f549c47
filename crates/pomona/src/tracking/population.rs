//! What the fruits of this visit have in common: their size.

use super::landmark::Size;
use super::observation::Lift;

/// Logarithms of radii are counted from 1 mm to 1 m, in steps of 2 %.
const SMALLEST_LN: f64 = -6.9;
const STEP_LN: f64 = 0.02;
const STEPS: usize = 346;

/// Lifted boxes before a size is taken for known.
const ENOUGH: usize = 10;

/// Least standard deviation of the logarithm of a radius: fruits of one tree differ by 8 to 12 %.
const LEAST_SPREAD: f64 = 0.1;

/// Part of the boxes whose radii must lie close together: the depths of the others may be wrong.
const AGREEING: f64 = 0.4;

/// Half the width of the middle 40 % of a normal distribution, in standard deviations.
const AGREEING_SIGMAS: f64 = 0.5244;

/// Counts of the radii of lifted boxes. Wrong depths make wrong sizes, of any size, so the shortest interval that holds
/// a part of all is not moved by them.
#[derive(Debug, Clone)]
pub(crate) struct Population {
    counts: Vec<usize>,
    total: usize,
}

impl Default for Population {
    fn default() -> Self {
        Self { counts: vec![0; STEPS], total: 0 }
    }
}

impl Population {
    pub fn add(&mut self, lift: &Lift) {
        let step = ((lift.radius_m.ln() - SMALLEST_LN) / STEP_LN).clamp(0.0, STEPS as f64 - 1.0);
        self.counts[step as usize] += 1;
        self.total += 1;
    }

    /// Size of a fruit of which nothing is known but that it is one of these.
    pub fn size(&self) -> Option<Size> {
        if self.total < ENOUGH {
            return None;
        }
        let (first, beyond) = self.shortest(AGREEING * self.total as f64);
        let spread = STEP_LN * (beyond - first) as f64 / (2.0 * AGREEING_SIGMAS);
        let ln_radius = SMALLEST_LN + STEP_LN * f64::midpoint(first as f64, beyond as f64);
        Some(Size { ln_radius, variance: spread.max(LEAST_SPREAD).powi(2) })
    }

    /// The shortest run of steps, first and one beyond the last, that holds `wanted` boxes; of equal ones the fullest.
    fn shortest(&self, wanted: f64) -> (usize, usize) {
        let mut best = (STEPS, 0, (0, STEPS));
        let (mut beyond, mut held) = (0, 0);
        for first in 0..STEPS {
            while beyond < STEPS && (held as f64) < wanted {
                held += self.counts[beyond];
                beyond += 1;
            }
            if (held as f64) < wanted {
                break;
            }
            let width = beyond - first;
            if width < best.0 || (width == best.0 && held > best.1) {
                best = (width, held, (first, beyond));
            }
            held -= self.counts[first];
        }
        best.2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn half_of_the_sizes_may_be_wrong() {
        let mut population = Population::default();
        for k in 0..100_u32 {
            let seen = Vector3::zeros();
            let right = 0.035 * (1.0 + 0.1 * (f64::from(k % 10) - 4.5) / 4.5);
            let wrong = 0.005 * 1.05_f64.powi(k as i32);
            for radius_m in [right, wrong] {
                population.add(&Lift { seen, covariance: Matrix3::zeros(), radius_m, radius_sigma: 0.1, support: 0.5 });
            }
        }
        let size = population.size().expect("enough");
        assert!((size.ln_radius - 0.035_f64.ln()).abs() < 0.06, "{}", size.ln_radius.exp());
        assert!(size.variance.sqrt() < 0.2);
    }
}
