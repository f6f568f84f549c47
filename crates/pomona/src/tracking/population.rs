//! What the fruits of this visit have in common: their size.

use super::landmark::Size;
use super::observation::Lift;

/// Lifted boxes before a size is taken for known.
const ENOUGH: f64 = 10.0;

/// Standard deviations beyond which a size is that of something else.
const STRANGE: f64 = 3.0;

/// Running mean and variance of the logarithms of the radii of lifted boxes.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Population {
    count: f64,
    mean: f64,
    /// Sum of squared deviations (Welford).
    squares: f64,
}

impl Population {
    /// Notes a radius, unless it is far from what fruits are here.
    pub fn add(&mut self, lift: &Lift) {
        let ln_radius = lift.radius_m.ln();
        if self.size().is_some_and(|size| (ln_radius - size.ln_radius).powi(2) > STRANGE.powi(2) * size.variance) {
            return;
        }
        self.count += 1.0;
        let deviation = ln_radius - self.mean;
        self.mean += deviation / self.count;
        self.squares += deviation * (ln_radius - self.mean);
    }

    /// Size of a fruit of which nothing is known but that it is one of these. Its variance has what leaves hide in it.
    pub fn size(&self) -> Option<Size> {
        (self.count >= ENOUGH).then(|| Size { ln_radius: self.mean, variance: self.squares / self.count })
    }
}
