//! Whether the rows of left and right pictures are the same, from corners that are found in both.
//!
//! Where one camera was knocked since it was calibrated, the right picture is lower by `lower_px` and turned by
//! `turned_rad` about its principal point,
//!
//! ```text
//! y_right - y_left = lower_px + turned_rad (x_right - cx) + stretch (y_left - cy) + noise,
//! ```
//!
//! whatever the depth. One match in five is wrong on foliage, so the fit is reweighted from the median on.

use crate::statistics::median;
use nalgebra::{Matrix3, Vector3};

/// Offset, pixels, and turn, radians, from which on rows count as misaligned; half a pixel, or 0.1 degrees, is always told
/// then: measured values err by up to 0.2 px and 0.02 degrees, and true ones of good pairs stay below 0.15 px.
const TOLD: [f64; 2] = [0.3, 0.08 * DEGREE];

/// Offset, pixels, and turn, radians, that are taken out at most. More is no knock, but another calibration, and the turn
/// about the camera's other axes, which rows do not show, would be as large.
pub const CORRECTED: [f64; 2] = [3.3, 0.55 * DEGREE];

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Corners found in both pictures without which nothing is said.
const ENOUGH: usize = 100;

/// Deviations beyond this count less (Tukey's weights).
const SPREAD_PX: f64 = 0.5;

/// The spread begins as many times as wide, so that corners at the sides of a turned picture count.
const FIRST_SPREAD: f64 = 8.0;

/// Rounds in which it narrows.
const ROUNDS: usize = 30;

/// How the right picture lies to the left one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment {
    /// By how much the right picture shows everything lower.
    pub lower_px: f64,
    /// By how much it is turned about its principal point, clockwise as seen.
    pub turned_rad: f64,
}

impl Alignment {
    /// Whether it is to be told.
    pub fn is_off(&self) -> bool {
        self.lower_px.abs() >= TOLD[0] || self.turned_rad.abs() >= TOLD[1]
    }

    /// Whether it is small enough to be taken out.
    pub fn is_correctable(&self) -> bool {
        self.lower_px.abs() <= CORRECTED[0] && self.turned_rad.abs() <= CORRECTED[1]
    }
}

/// Rows above and below that hold the match of a corner, in pictures of this width.
pub fn reach_px(width: usize) -> usize {
    (CORRECTED[0] + CORRECTED[1] * width as f64 / 2.0 + 2.0).ceil() as usize
}

/// Fits the alignment to corners: column in the right picture, row in the left one, difference of the rows. None where
/// they are too few.
pub fn fitted(corners: &[Vector3<f64>], centre_px: [f64; 2]) -> Option<Alignment> {
    if corners.len() < ENOUGH {
        return None;
    }
    let mut lower: Vec<f64> = corners.iter().map(|corner| corner.z).collect();
    let mut solution = Vector3::new(median(&mut lower), 0.0, 0.0);
    for round in 0..ROUNDS {
        let part = round as f64 / (ROUNDS - 1) as f64;
        let spread_px = SPREAD_PX * FIRST_SPREAD.powf(1.0 - part);
        let Some(next) = reweighted(corners, centre_px, &solution, spread_px) else { break };
        solution = next;
    }
    Some(Alignment { lower_px: solution.x, turned_rad: solution.y })
}

/// None where the corners that count do not fix all three.
fn reweighted(
    corners: &[Vector3<f64>],
    centre_px: [f64; 2],
    solution: &Vector3<f64>,
    spread_px: f64,
) -> Option<Vector3<f64>> {
    let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for corner in corners {
        let terms = Vector3::new(1.0, corner.x - centre_px[0], corner.y - centre_px[1]);
        let off = (corner.z - terms.dot(solution)) / (4.0 * spread_px);
        let weight = (1.0 - off * off).max(0.0).powi(2);
        matrix += weight * terms * terms.transpose();
        right += weight * corner.z * terms;
    }
    if !matrix.sum().is_finite() {
        return None;
    }
    let spectrum = matrix.symmetric_eigenvalues();
    let is_whole = spectrum.min() > 3.0 * f64::EPSILON * spectrum.max();
    if is_whole { Some(matrix.cholesky()?.solve(&right)) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix;

    /// Corners of a knocked pair: a fifth of them are wrong matches.
    fn corners(n: usize, lower_px: f64, turned_rad: f64) -> Vec<Vector3<f64>> {
        let mut random = SplitMix(7);
        let mut unit = || random.below(1 << 20) as f64 / f64::from(1 << 20);
        let corner = |k: usize| {
            let (x, y, noise) = (640.0 * unit(), 360.0 * unit(), 6.0 * (unit() - 0.5));
            let off = if k.is_multiple_of(5) { noise } else { 0.1 * noise };
            Vector3::new(x, y, lower_px + turned_rad * (x - 320.0) + 0.001 * (y - 180.0) + off)
        };
        (0..n).map(corner).collect()
    }

    #[test]
    fn offset_and_turn_are_found_among_wrong_matches() {
        for (lower_px, turned_rad) in [(0.0, 0.0), (2.0, 0.004), (-3.0, -0.009)] {
            let found = fitted(&corners(500, lower_px, turned_rad), [320.0, 180.0]).expect("enough corners");
            assert!((found.lower_px - lower_px).abs() < 0.1, "{found:?}");
            assert!((found.turned_rad - turned_rad).abs() < 3e-4, "{found:?}");
        }
    }

    #[test]
    fn too_few_corners_say_nothing() {
        assert!(fitted(&corners(99, 1.0, 0.0), [320.0, 180.0]).is_none());
        assert!(fitted(&corners(100, 1.0, 0.0), [320.0, 180.0]).is_some());
    }

    #[test]
    fn corners_of_one_row_leave_the_median() {
        let one_row: Vec<_> = (0..200).map(|x| Vector3::new(f64::from(x), 180.0, 0.7)).collect();
        assert_eq!(fitted(&one_row, [320.0, 180.0]), Some(Alignment { lower_px: 0.7, turned_rad: 0.0 }));
    }

    #[test]
    fn what_is_told_and_what_is_taken_out() {
        let told = |lower_px, turned_rad: f64| Alignment { lower_px, turned_rad: turned_rad.to_radians() };
        assert!(!told(0.29, 0.079).is_off() && told(-0.3, 0.0).is_off() && told(0.0, 0.081).is_off());
        assert!(told(3.3, -0.54).is_correctable() && !told(3.4, 0.0).is_correctable());
        assert!(!told(0.0, 0.56).is_correctable());
        assert_eq!((reach_px(640), reach_px(1280)), (9, 12));
    }
}
