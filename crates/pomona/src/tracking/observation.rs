//! What one frame shows: boxes, and the depth of those that have one.

use super::sphere::Interval;
use crate::camera::Camera;
use crate::cloud::is_covariance;
use crate::error::{Error, Result};
use nalgebra::{Matrix3, Vector3};

/// A box edge this near the edge of the picture is the picture's, not the fruit's.
const PICTURE_EDGE_PX: f64 = 1.0;

/// Boxes of one frame.
#[derive(Debug, Clone, Copy)]
pub struct Boxes<'a> {
    /// xmin, ymin, xmax, ymax, pixels.
    pub edges_px: &'a [[f64; 4]],
    /// Confidence, 0 to 1.
    pub scores: &'a [f64],
}

/// Boxes whose depth is known, as fruits in the frame of the camera.
#[derive(Debug, Clone, Copy)]
pub struct LiftedBoxes<'a> {
    /// Row of the box, each at most once.
    pub rows: &'a [usize],
    /// Centres of the fruits, metres.
    pub centres_in_camera: &'a [Vector3<f64>],
    /// Their covariances, square metres.
    pub covariances: &'a [Matrix3<f64>],
    /// Diameters, metres.
    pub diameters_m: &'a [f64],
    /// Their standard deviations, what leaves hide included, metres.
    pub diameter_sigmas_m: &'a [f64],
    /// Part of the outline's pixels whose depth is on the fruit, 0 to 1.
    pub support: &'a [f64],
}

impl LiftedBoxes<'_> {
    /// No box has a depth.
    pub const NONE: Self = Self {
        rows: &[],
        centres_in_camera: &[],
        covariances: &[],
        diameters_m: &[],
        diameter_sigmas_m: &[],
        support: &[],
    };
}

/// One box as the tracker sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Observation {
    pub sides: [PixelSide; 2],
    pub score: f64,
    pub lift: Option<Lift>,
}

impl Observation {
    /// xmin, ymin, xmax, ymax.
    pub fn edges(&self) -> [f64; 4] {
        let [across, down] = self.sides.map(|side| side.edges);
        [across.low, down.low, across.high, down.high]
    }
}

/// One axis of a box: its edges, and which of them the picture cuts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PixelSide {
    pub edges: Interval,
    /// Where the centre of a sphere with these edges projects to, and its R / Z.
    pub middle: f64,
    pub ratio: f64,
    pub cut: [bool; 2],
}

impl PixelSide {
    pub fn whole(self) -> bool {
        !self.cut[0] && !self.cut[1]
    }
}

/// Where depth puts the fruit of a box.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lift {
    /// Column, row (pixels) and depth (metres) of the centre.
    pub seen: Vector3<f64>,
    /// Its covariance.
    pub covariance: Matrix3<f64>,
    pub radius_m: f64,
    /// Standard deviation of the radius over the radius.
    pub radius_sigma: f64,
    pub support: f64,
}

/// The observations of one frame, one per box.
///
/// # Errors
/// An array has another length than the others, or a row is no box.
pub(crate) fn observations(camera: &Camera, boxes: &Boxes<'_>, lifted: &LiftedBoxes<'_>) -> Result<Vec<Observation>> {
    check_lengths(boxes, lifted)?;
    let mut all: Vec<_> = boxes
        .edges_px
        .iter()
        .zip(boxes.scores)
        .map(|(&edges_px, &score)| Observation { sides: sides(camera, edges_px), score, lift: None })
        .collect();
    for (k, &row) in lifted.rows.iter().enumerate() {
        all[row].lift = lift(camera, lifted, k);
    }
    Ok(all)
}

fn check_lengths(boxes: &Boxes<'_>, lifted: &LiftedBoxes<'_>) -> Result<()> {
    let n_boxes = boxes.edges_px.len();
    let n_lifted = lifted.rows.len();
    for (what, found, expected) in [
        ("scores", boxes.scores.len(), n_boxes),
        ("centres_in_camera", lifted.centres_in_camera.len(), n_lifted),
        ("covariances", lifted.covariances.len(), n_lifted),
        ("diameters_m", lifted.diameters_m.len(), n_lifted),
        ("diameter_sigmas_m", lifted.diameter_sigmas_m.len(), n_lifted),
        ("support", lifted.support.len(), n_lifted),
    ] {
        if found != expected {
            return Err(Error::Length { what, found, expected });
        }
    }
    if let Some(&found) = lifted.rows.iter().find(|&&row| row >= n_boxes) {
        return Err(Error::Row { what: "lifted.rows", found, below: n_boxes });
    }
    // A depth that is no number is none; one that has no spread would draw every fruit to it.
    let is_wrong = |matrix: &Matrix3<f64>| matrix.iter().all(|x| x.is_finite()) && !is_covariance(matrix);
    lifted.covariances.iter().position(is_wrong).map_or(Ok(()), |row| Err(Error::Covariance { row }))
}

fn sides(camera: &Camera, [xmin, ymin, xmax, ymax]: [f64; 4]) -> [PixelSide; 2] {
    let side = |axis: usize, low: f64, high: f64| {
        let size = camera.size_px()[axis];
        let edges = Interval { low: low.max(0.0), high: high.min(size) };
        let (middle, ratio) = camera.middle_and_ratio(axis, edges);
        PixelSide { edges, middle, ratio, cut: [low <= PICTURE_EDGE_PX, high >= size - PICTURE_EDGE_PX] }
    };
    [side(0, xmin, xmax), side(1, ymin, ymax)]
}

/// None where the numbers are not those of a fruit in front of the camera: then the box counts alone.
fn lift(camera: &Camera, lifted: &LiftedBoxes<'_>, k: usize) -> Option<Lift> {
    let centre = lifted.centres_in_camera[k];
    let to_seen = camera.projection_jacobian(&centre);
    let lift = Lift {
        seen: camera.project(&centre),
        covariance: to_seen * lifted.covariances[k] * to_seen.transpose(),
        radius_m: lifted.diameters_m[k] / 2.0,
        radius_sigma: lifted.diameter_sigmas_m[k] / lifted.diameters_m[k],
        support: lifted.support[k],
    };
    let is_finite = lift.seen.iter().chain(lift.covariance.iter()).chain([&lift.support]).all(|x| x.is_finite());
    (is_finite && centre.z > 0.0 && lift.radius_m > 0.0 && lift.radius_sigma > 0.0).then_some(lift)
}
