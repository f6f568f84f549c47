//! From a box and a depth picture to a fruit in 3D.
//!
//! The outline ([`outline`]) fixes a fruit up to its distance: centre c = (X/Z, Y/Z, 1), radius s = R/Z. The depth
//! picture gives Z ([`surface`]). The fruit is then at Z c with the diameter 2 s Z. So the centre lies behind the
//! surface by the radius that the outline gives, on the axis Z = depth / (1 - s); no constant is added.
//!
//! Covariance of the centre, to first order, with the ray c as its long axis:
//!
//! ```text
//! C = var(Z) c c^T + Z^2 diag(sigma_cx^2, sigma_cy^2, 0)
//! var(Z) = sigma_vote^2 / n + (Z sigma_s)^2 + (roundness R)^2 + (scale Z)^2 + (Z^2 sigma_d / (f B))^2      (4)
//! ```
//!
//! `sigma_vote` is the spread of the depths that agree: noise and the surface's own shape; n the number of independent
//! patches of surface they come from; Z `sigma_s` the outline's error, which moves the centre behind the surface; then
//! what fruits differ from a sphere, the depth camera's own scale, and for a stereo pair what the disparities of one
//! fruit err by together, `sigma_d`. The diameter has the variance
//!
//! ```text
//! var(D) = (2 Z sigma_s)^2 + (2 s)^2 var(Z) + (roundness D)^2 + (hidden D)^2,                              (5)
//! ```
//!
//! hidden being the part of it that leaves are expected to hide: such boxes are too small, never too large.

mod edges;
pub mod fruits;
pub mod fusion;
pub mod outline;
mod shift;
pub mod surface;

use crate::camera::{Camera, DepthPicture, PixelBox};
use edges::covered_edges;
use nalgebra::{Matrix3, Point3, Vector3};
use outline::Outline;
use shift::shifted;
use surface::{DepthVote, Pixel, vote_for_depth};

/// How far fruits are from a sphere, over the radius (or diameter): calipers on two diameters of an apple differ by
/// 2-5 %.
const ROUNDNESS_SIGMA: f64 = 0.03;

/// Error of depth in proportion to depth, as the makers of time-of-flight cameras state it.
const SCALE_SIGMA: f64 = 0.001;

/// Mean part of the diameter that leaves hide, by the number of axes on which no leaf covers an edge: 0, 1, 2. With
/// `HIDDEN_UNSUPPORTED` it makes what boxes around the visible part of rendered fruits lack: 10, 6 and 3 %.
const HIDDEN: [f64; 3] = [0.09, 0.04, 0.02];

/// What is added to it for a fruit of which nearly nothing agrees with the outline.
const HIDDEN_UNSUPPORTED: f64 = 0.04;

/// The same of a fruit that does not match in a pair: leaves hide it from one camera, so from the other in part.
const HIDDEN_UNMATCHED: f64 = 0.09;

/// Independent patches on the face of a whole fruit: shape and filters err alike over a third of the diameter. With it
/// the same apples scatter between captures by no more than the covariances say.
const SURFACE_PATCHES: f64 = 8.0;

/// Why a box did not become a fruit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Refusal {
    /// The edge of the picture leaves its size or place open.
    Cut,
    /// Too few pixels have a depth.
    NoDepth,
    /// The other picture of a pair shows no sure match, and no size of fruits is known.
    Unmatched,
}

/// Where the depth of a fruit's centre comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// The depth picture: its pixels vote.
    Votes {
        /// `sigma_d / (f B)` where the picture is of a stereo pair, else 0.
        sigma_per_m2: f64,
    },
    /// A pair in which the fruit was matched as one.
    Match {
        /// Depth of the centre.
        depth_m: f64,
        /// `sigma_d / (f B)`.
        sigma_per_m2: f64,
        /// Part of the outline that matches; 0 where the depth is only what the fruit's size says.
        support: f64,
    },
    /// A pair in which it was not.
    Unmatched,
}

/// A fruit seen in one picture, in the frame of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LiftedFruit {
    /// Metres.
    pub centre: Point3<f64>,
    /// Square metres.
    pub covariance: Matrix3<f64>,
    /// Metres.
    pub diameter_m: f64,
    /// Its standard deviation, what leaves hide included.
    pub diameter_sigma_m: f64,
    /// Mean part of the diameter that leaves are expected to hide.
    pub hidden: f64,
    /// Part of the outline's pixels whose depth is on the fruit; 0 where the depth is only what its size says.
    pub support: f64,
}

/// Lifts boxes (xmin, ymin, xmax, ymax) to fruits; what is outside the picture is cut.
///
/// # Panics
/// When boxes and sources differ in number, or the camera from the depth picture in size.
pub fn lift(
    depth: DepthPicture,
    boxes_px: &[[f64; 4]],
    sources: &[Source],
    camera: &Camera,
) -> Vec<Result<LiftedFruit, Refusal>> {
    assert_eq!(boxes_px.len(), sources.len(), "one source per box");
    assert_eq!((depth.width(), depth.height()), (camera.width, camera.height), "the camera of the depth picture");
    let lift = |(&box_px, &source)| lift_box(depth, clipped(box_px, camera), source, camera);
    boxes_px.iter().zip(sources).map(lift).collect()
}

fn clipped(box_px: [f64; 4], camera: &Camera) -> [f64; 4] {
    let (width, height) = (camera.width as f64, camera.height as f64);
    let [xmin, ymin, xmax, ymax] = box_px;
    [xmin.clamp(0.0, width), ymin.clamp(0.0, height), xmax.clamp(0.0, width), ymax.clamp(0.0, height)]
}

fn lift_box(depth: DepthPicture, box_px: [f64; 4], source: Source, camera: &Camera) -> Result<LiftedFruit, Refusal> {
    let mut outline = Outline::of_box(box_px, camera, [false; 4]).ok_or(Refusal::Cut)?;
    let (sigma_per_m2, matched) = match source {
        Source::Votes { sigma_per_m2 } => (sigma_per_m2, None),
        // The pixels of a match err together: nothing of its scatter averages out.
        Source::Match { depth_m, sigma_per_m2, support } => {
            (sigma_per_m2, Some(DepthVote { depth_m, sigma_m: 0.0, support }))
        }
        Source::Unmatched => return Err(Refusal::Unmatched),
    };
    let pixels = pixels(depth, box_px, camera);
    let vote_under = |outline: &Outline| matched.or_else(|| vote_for_depth(&pixels, outline.centre, outline.radius));
    let mut vote = vote_under(&outline).ok_or(Refusal::NoDepth)?;
    // Around a fruit whose depth is only guessed nothing can be nearer or farther than it.
    let covered =
        if vote.support > 0.0 { covered_edges(depth, box_px, vote.depth_m, outline.radius) } else { [false; 4] };
    if covered.contains(&true) {
        outline = Outline::of_box(box_px, camera, covered).unwrap_or(outline);
        vote = vote_under(&outline).unwrap_or(vote);
    }
    if let Some(axis) = outline.hidden_axis {
        let noise_m = sigma_per_m2 * vote.depth_m * vote.depth_m;
        (outline.centre, outline.centre_sigma) = shifted(&pixels, &outline, axis, &vote, noise_m);
        vote = vote_under(&outline).unwrap_or(vote);
    }
    Ok(sighting(&outline, &vote, sigma_per_m2))
}

fn pixels(depth: DepthPicture, box_px: [f64; 4], camera: &Camera) -> Vec<Pixel> {
    PixelBox::new(box_px, 0, depth.width(), depth.height())
        .pixels()
        .map(|(column, row)| Pixel { depth_m: depth.at(column, row), ray: camera.pixel_ray(column, row) })
        .collect()
}

/// Puts a fruit together with its covariance, equations (4) and (5).
fn sighting(outline: &Outline, vote: &DepthVote, depth_sigma_per_m2: f64) -> LiftedFruit {
    let (z, s) = (vote.depth_m, outline.radius);
    let diameter_m = 2.0 * s * z;
    let patches = (SURFACE_PATCHES * vote.support).max(1.0);
    let along2 = vote.sigma_m.powi(2) / patches
        + (z * outline.radius_sigma).powi(2)
        + (ROUNDNESS_SIGMA * s * z).powi(2)
        + (SCALE_SIGMA * z).powi(2)
        + (depth_sigma_per_m2 * z * z).powi(2);
    let ray = Vector3::new(outline.centre[0], outline.centre[1], 1.0);
    let [sigma_x, sigma_y] = outline.centre_sigma.map(|sigma| z * sigma);
    let across = Matrix3::from_diagonal(&Vector3::new(sigma_x * sigma_x, sigma_y * sigma_y, 0.0));
    let hidden = if vote.support > 0.0 {
        HIDDEN[outline.whole_axes] + HIDDEN_UNSUPPORTED * (1.0 - vote.support)
    } else {
        HIDDEN_UNMATCHED
    };
    let diameter_variance = (2.0 * z * outline.radius_sigma).powi(2)
        + 4.0 * s * s * along2
        + (ROUNDNESS_SIGMA.powi(2) + hidden * hidden) * diameter_m * diameter_m;
    LiftedFruit {
        centre: Point3::from(ray * z),
        covariance: ray * ray.transpose() * along2 + across,
        diameter_m,
        diameter_sigma_m: diameter_variance.sqrt(),
        hidden,
        support: vote.support,
    }
}
