//! Where a fruit lies that is hidden along one side of its box: the mean over the likelihood of its depths under shifts.

use super::SURFACE_PATCHES;
use super::outline::Outline;
use super::surface::{DepthVote, MIN_PIXELS, MIN_SURFACE_SIGMA_M, P_GAP, Pixel, RIM, UnitSphere};
use crate::statistics::median;

/// Places tried along the hidden side of a box; the farthest two leave the fruit flush with one edge.
const SHIFTS: usize = 17;

/// Sigma of the surface over the radius while its place along a hidden side is sought: shape counts here, not only
/// depth.
const SHAPE_SIGMA: f64 = 0.1;

/// Centre (X/Z, Y/Z) and its sigma, of an outline hidden along `axis`, in a picture with `noise_m` of its own.
pub(crate) fn shifted(
    pixels: &[Pixel],
    outline: &Outline,
    axis: usize,
    vote: &DepthVote,
    noise_m: f64,
) -> ([f64; 2], [f64; 2]) {
    let near: Vec<Pixel> = pixels
        .iter()
        .filter(|pixel| pixel.depth_m > 0.0 && (pixel.depth_m / vote.depth_m - 1.0).abs() < 1.5 * outline.radius)
        .copied()
        .collect();
    let sigma_m = (MIN_SURFACE_SIGMA_M / 2.0).max(SHAPE_SIGMA * outline.radius * vote.depth_m).hypot(noise_m);
    let shift = |k: usize| outline.slack * (2.0 * k as f64 / (SHIFTS - 1) as f64 - 1.0);
    let mut log_likelihoods = [0.0; SHIFTS];
    for (k, one) in log_likelihoods.iter_mut().enumerate() {
        let mut centre = outline.centre;
        centre[axis] += shift(k);
        let sphere = UnitSphere::new(centre, outline.radius, RIM);
        *one = log_likelihood(&near, &sphere, sigma_m) * SURFACE_PATCHES / near.len().max(1) as f64;
    }
    let highest = log_likelihoods.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights = log_likelihoods.map(|one| (one - highest).exp());
    let total: f64 = weights.iter().sum();
    let mean = weights.iter().enumerate().map(|(k, weight)| weight * shift(k)).sum::<f64>() / total;
    let variance =
        weights.iter().enumerate().map(|(k, weight)| weight * (shift(k) - mean).powi(2)).sum::<f64>() / total;
    let (mut centre, mut centre_sigma) = (outline.centre, outline.centre_sigma);
    centre[axis] += mean;
    centre_sigma[axis] = centre_sigma[axis].hypot(variance.sqrt());
    (centre, centre_sigma)
}

/// Log likelihood of depths near a fruit under a sphere, at its best distance.
fn log_likelihood(near: &[Pixel], sphere: &UnitSphere, sigma_m: f64) -> f64 {
    let off = P_GAP.ln();
    let inside: Vec<(f64, f64)> =
        near.iter().filter_map(|pixel| sphere.depth(pixel.ray).map(|t| (pixel.depth_m, t))).collect();
    if inside.len() < MIN_PIXELS {
        return off * near.len() as f64;
    }
    let mut votes: Vec<f64> = inside.iter().map(|(d, t)| d / t).collect();
    let centre_m = median(&mut votes);
    let on: f64 =
        inside.iter().map(|(d, t)| (P_GAP + (-0.5 * ((d - centre_m * t) / sigma_m).powi(2)).exp()).ln()).sum();
    on + off * (near.len() - inside.len()) as f64
}
