//! Findings along a line: a cordon, a wire, fruits that hang as near it as noise puts them.
//!
//! On a line the turn about it stays open, and wrong poses are as many more as there are such turns: each lays the line on itself.

use super::case::Finding;
use crate::moments::Moments;

/// Standard error of the turn about the line of the pairs from which on it is open, radians: 6 degrees.
const LOOSEST_TURN_RAD: f64 = 0.1;

/// Standard deviations of the noise within which fruits make a line.
const THIN: f64 = 3.0;

impl Finding<'_> {
    /// Whether the pairs leave the line so far, and are so many, that they fix the turn about it.
    ///
    /// Of n pairs that leave it by s beside the noise, per axis, the turn has the standard error `sigma / (s n^(1/2))`.
    pub(super) fn turns_are_fixed(&self) -> bool {
        let pairs = self.growth.partners.iter().flatten().count() as f64;
        pairs * (self.across() - 1.0) * LOOSEST_TURN_RAD.powi(2) > 1.0
    }

    /// Whether the fruits of the overlap lie along a line.
    pub(super) fn is_a_line(&self) -> bool {
        self.across() < THIN * THIN
    }

    /// Variance of the fruits of the overlap across their line, the larger of both ways, over that of the noise; 0 where there are none.
    fn across(&self) -> f64 {
        let mut moments = Moments::default();
        for (p, prediction) in self.growth.patches.query.points.iter().zip(&self.overlap.predictions) {
            if let Some(at) = prediction {
                moments.add(p, &at.place, 1.0);
            }
        }
        if moments.weight <= 0.0 {
            return 0.0;
        }
        let mut spread = moments.spread().symmetric_eigenvalues();
        spread.as_mut_slice().sort_by(f64::total_cmp);
        let noise = self.overlap.sigma / self.overlap.pose.scale;
        spread[1] / (noise * noise)
    }
}
