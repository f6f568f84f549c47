//! The front of a round fruit in a depth picture: where it is.
//!
//! With centre c = (X/Z, Y/Z, 1) and radius s = R/Z of its outline, a pixel with the ray q = (x, y, 1) meets the front of
//! the fruit at the depth t Z, where `|t q - c|^2 = s^2`:
//!
//! ```text
//! t = (q.c - sqrt((q.c)^2 - |q|^2 (|c|^2 - s^2))) / |q|^2.                                         (2)
//! ```
//!
//! So **every pixel votes for the depth of the centre**, Z = d / t. Pixels on the fruit agree, a leaf in front votes
//! nearer, the row behind farther, and the best supported vote wins:
//!
//! ```text
//! log L(Z) = sum_pixels log( p_fruit N(d; t Z, sigma) + p_leaf U(in front) + p_gap U(behind) )     (3)
//! ```
//!
//! with `p_leaf > p_gap`: a leaf in front is common, but nothing is seen through a fruit, so a depth behind the surface
//! speaks against it. Tukey's biweight refines the winner. The size never comes from the curvature of the depth: depth
//! cameras flatten small spheres (skin lets infrared in, filters smooth). A sphere fitted to box and depth together
//! made apples 25 mm too large on average; the box alone 6 mm, most of it a nominal focal length.

use crate::statistics::{median, quantile_of_sorted};

/// Part of the outline's radius that votes: beyond it the surface is steep and depth cameras mix it with what is behind.
const FACE: f64 = 0.85;

/// The same when few pixels inside `FACE` have a depth, and for the shift of a partly hidden fruit, which shows at the
/// rim.
pub(crate) const RIM: f64 = 0.97;

/// Fewer depths than this in a box are a matter of chance.
pub(crate) const MIN_PIXELS: usize = 8;

/// Sigma of equation (3) over the radius: a leaf is farther than this from the surface, a dent or stalk pit is not.
const SURFACE_SIGMA: f64 = 0.2;

/// Sigma of equation (3) for the smallest fruits: what depth cameras scatter.
pub(crate) const MIN_SURFACE_SIGMA_M: f64 = 0.003;

/// Depth pictures come in steps of 1 mm.
const MIN_VOTE_SIGMA_M: f64 = 0.0005;

/// Shares of the pixels in an outline: on the fruit, hidden by a leaf, or through to what is behind (bad outline or
/// depth).
const P_FRUIT: f64 = 0.6;
const P_LEAF: f64 = 0.35;
pub(crate) const P_GAP: f64 = 0.05;

/// How far in front hide leaves and branches, how far behind the next row begins: the ranges of the uniform parts of (3).
const LEAF_RANGE_M: f64 = 0.3;
const GAP_RANGE_M: f64 = 1.0;

/// Depths tried in (3), at equal steps of rank of the votes: never farther apart than a fiftieth of the votes.
const CANDIDATES: usize = 49;

/// Beyond this many sigma a Gaussian is below the precision of the sum that it is part of.
const NEGLIGIBLE_SIGMAS: f64 = 9.0;

/// A pixel of a box: its depth, 0 where there is none, and its ray.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pixel {
    pub(crate) depth_m: f64,
    pub(crate) ray: [f64; 3],
}

/// Depth of the centre, the spread of the votes that agree, their share of the outline's pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthVote {
    /// Depth of the centre.
    pub depth_m: f64,
    /// Spread of the votes that agree.
    pub sigma_m: f64,
    /// Their share of the outline's pixels.
    pub support: f64,
}

/// A sphere at unit depth: what equation (2) needs.
#[derive(Debug, Clone, Copy)]
pub struct UnitSphere {
    centre: [f64; 3],
    radius2: f64,
    part: f64,
}

impl UnitSphere {
    /// The part within `part` of the radius about the axis of a sphere at X/Z, Y/Z with radius R/Z.
    pub fn new(centre: [f64; 2], radius: f64, part: f64) -> Self {
        Self { centre: [centre[0], centre[1], 1.0], radius2: radius * radius, part }
    }

    /// t of equation (2) where a ray meets the sphere.
    pub fn depth(&self, ray: [f64; 3]) -> Option<f64> {
        let along = dot(ray, self.centre);
        let length2 = dot(ray, ray);
        let root2 = along * along - length2 * (dot(self.centre, self.centre) - self.radius2);
        // The ray passes the centre at h with (h / R)^2 = 1 - root2 / (|q| s)^2.
        (root2 > (1.0 - self.part * self.part) * length2 * self.radius2).then(|| (along - root2.sqrt()) / length2)
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Finds the depth of the centre that the pixels agree on; none where fewer than `MIN_PIXELS` have a depth.
pub(crate) fn vote_for_depth(pixels: &[Pixel], centre: [f64; 2], radius: f64) -> Option<DepthVote> {
    for part in [FACE, RIM] {
        let sphere = UnitSphere::new(centre, radius, part);
        let mut inside = 0;
        let mut measured: Vec<(f64, f64)> = Vec::with_capacity(pixels.len());
        for pixel in pixels {
            if let Some(t) = sphere.depth(pixel.ray) {
                inside += 1;
                if pixel.depth_m > 0.0 {
                    measured.push((pixel.depth_m, t));
                }
            }
        }
        if measured.len() >= MIN_PIXELS {
            let votes: Vec<f64> = measured.iter().map(|(d, t)| d / t).collect();
            let start_m = best_supported(&measured, &votes, radius);
            let (depth_m, sigma_m, agree) = biweight(&votes, start_m, SURFACE_SIGMA * radius * start_m);
            return Some(DepthVote { depth_m, sigma_m, support: agree as f64 / f64::from(inside) });
        }
    }
    None
}

/// Maximises equation (3) over the votes themselves.
fn best_supported(measured: &[(f64, f64)], votes: &[f64], radius: f64) -> f64 {
    let mut sorted = votes.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let candidate = |k: usize| quantile_of_sorted(&sorted, 0.02 + 0.96 * k as f64 / (CANDIDATES - 1) as f64);
    let mut best = (f64::NEG_INFINITY, f64::NAN);
    for depth_m in (0..CANDIDATES).map(candidate) {
        let log_likelihood = log_likelihood(measured, depth_m, radius);
        if log_likelihood > best.0 {
            best = (log_likelihood, depth_m);
        }
    }
    best.1
}

/// Equation (3) at one depth.
fn log_likelihood(measured: &[(f64, f64)], depth_m: f64, radius: f64) -> f64 {
    let sigma = MIN_SURFACE_SIGMA_M.max(SURFACE_SIGMA * radius * depth_m);
    let peak = P_FRUIT / (sigma * (2.0 * std::f64::consts::PI).sqrt());
    let density = |&(d, t): &(f64, f64)| {
        let behind = d - depth_m * t;
        let elsewhere = if behind < 0.0 { P_LEAF / LEAF_RANGE_M } else { P_GAP / GAP_RANGE_M };
        let off = behind / sigma;
        if off.abs() < NEGLIGIBLE_SIGMAS { elsewhere + peak * (-0.5 * off * off).exp() } else { elsewhere }
    };
    // One logarithm for eight factors, each between 0.05 and 1000: the product stays far inside the range of f64.
    measured.chunks(8).map(|some| some.iter().map(density).product::<f64>().ln()).sum()
}

/// Tukey's biweight mean about `start_m`: the mean, the spread of the votes within 3 sigma, their number.
fn biweight(votes: &[f64], start_m: f64, sigma_m: f64) -> (f64, f64, usize) {
    let (mut mean, mut sigma, widest) = (start_m, sigma_m, sigma_m);
    let mut near: Vec<f64> = Vec::with_capacity(votes.len());
    for _ in 0..10 {
        let (mut total, mut moved) = (0.0, 0.0);
        for vote in votes {
            let off = (vote - mean) / (3.0 * sigma);
            let weight = (1.0 - off * off).max(0.0);
            total += weight * weight;
            moved += weight * weight * (vote - mean);
        }
        if total > 0.0 {
            mean += moved / total;
        }
        near.clear();
        near.extend(votes.iter().map(|vote| (vote - mean).abs()).filter(|&off| off < 3.0 * widest));
        if !near.is_empty() {
            // max before min, as widest may be below the floor.
            sigma = (1.4826 * median(&mut near)).max(MIN_VOTE_SIGMA_M).min(widest);
        }
    }
    (mean, sigma, votes.iter().filter(|&vote| (vote - mean).abs() < 3.0 * sigma).count())
}
