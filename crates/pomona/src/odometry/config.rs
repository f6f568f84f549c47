//! Settings of the odometry.

use super::following::MAX_WINDOW_PX;
use crate::error::{Error, Result};
use crate::meanings::settings;
use serde::{Deserialize, Serialize};

settings! {
/// Where the camera went, from stereo or depth pictures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OdometryConfig {
    /// Points that must agree with a pose. Wrong poses of foliage gather up to 13 points, true ones 25 or more.
    pub min_inliers: usize,
    /// Part of the followed points that must agree. Wrong poses of foliage gather up to 30 %, true ones 42 % or more.
    pub min_share: f64,
    /// Points that must agree with a pose that is not where the motion so far leads to.
    pub sure_inliers: usize,
    /// Part of the followed points that must agree with such a pose.
    pub sure_share: f64,
    /// How far from there that is, metres: 0.15 m from frame to frame is 10 g at 25 frames/s.
    pub smooth_m: f64,
    /// How far from there that is, radians: 9 degrees from frame to frame are 220 degrees/s.
    pub smooth_rad: f64,
    /// Points below which those that were not found are looked for again where the found pose shows them.
    pub enough_inliers: usize,
    /// A new keyframe is due when fewer than this part of the last one's points agree.
    pub keyframe_share: f64,
    /// Or when the camera has moved by this part of the median depth: then leaves hide leaves.
    pub keyframe_shift: f64,
    /// Or when it has turned by this, radians: 9 degrees.
    pub keyframe_rad: f64,
    /// Points that a keyframe should share with the one before; with 0.5 px each they turn it to half a milliradian.
    pub wanted_inliers: usize,
    /// Corners of a cell that are followed for that, at least: on walls nearly all of them agree.
    pub least_per_cell: usize,
    /// The same, at most: on foliage from 20 cm further one in ten agrees.
    pub most_per_cell: usize,
    /// Standard deviation of a followed corner, pixels: on foliage the residuals scatter by that, on walls by half of it.
    pub sigma_px: f64,
    /// Standard deviation of a disparity, pixels. The reason of `sigma_px`.
    pub sigma_disparity_px: f64,
    /// Standard deviation of patches matched at corners, pixels: corners are whole pixels on both sides.
    pub match_sigma_px: f64,
    /// Keyframes that an adjustment may move. A point is seen by fewer than that.
    pub free: usize,
    /// Older keyframes that stay where they are and hold the others through the points in common.
    pub held: usize,
    /// Squared Mahalanobis distance over which an observation is thrown away after an adjustment: 99.9 % of the true ones
    /// are nearer (`chi^2`, 3 degrees of freedom).
    pub gate: f64,
    /// Steps of one adjustment at most; the next keyframe goes on from there.
    pub max_steps: usize,
    /// What is nearer than this is not in focus and is not followed, metres.
    pub nearest_m: f64,
    /// Depths from here on are searched for, metres: nearer things fill the picture with one leaf.
    pub searched_m: f64,
    /// A depth camera counts as a stereo camera this wide, metres: 0.5 px of disparity are then 5 mm at 1 m with f = 900 px,
    /// and grow with the square of the depth, as those of active stereo do; time-of-flight cameras are better than that.
    pub depth_baseline_m: f64,
    /// What is looked for in the pictures.
    pub pictures: PicturesConfig,
}
}

settings! {
/// Corners, how they are followed, and how they are found again without an idea where.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PicturesConfig {
    /// Standard deviation in grey steps under which a picture shows nothing: black, covered or burnt out.
    pub flat_contrast: f64,
    /// Corners and whole disparities are looked for in the first halving that is no taller than this, pixels: a taller
    /// picture shows the same, in 15 x 15 pixels less of it.
    pub tallest_px: usize,
    /// Cells over which corners are spread, along the picture: 144 of 16 : 9. As many in a larger picture: it shows the same.
    pub cells_across: usize,
    /// Between corners, pixels: nearer ones see the same window.
    pub min_distance_px: usize,
    /// Smallest eigenvalue of a corner's gradients, for pictures from 0 to 1: noise of one grey step stays below it.
    pub min_corner: f64,
    /// Corners this near to the edge of the picture are not taken, pixels: their windows are cut.
    pub edge_px: usize,
    /// Side of the windows that are compared, pixels: about a leaf at 1.5 m. Larger ones see two depths at once more often.
    pub window_px: usize,
    /// Halvings of the picture: finds what is up to about 20 px from where it is expected.
    pub levels: usize,
    /// Steps of a point in one halving, at most: what is there settles within these, what wanders on comes home by chance.
    pub max_steps: usize,
    /// A step below this settles a point, pixels.
    pub settled_px: f64,
    /// A point that is followed forth and back must come home to this, pixels; occluded and repeated texture does not.
    pub forth_and_back_px: f64,
    /// Rectified pictures show a point in the same row, to this many pixels; real ones are off by a few tenths.
    pub max_row_error_px: f64,
    /// Least disparity, pixels: two standard deviations; what is farther has a direction and no place.
    pub min_disparity_px: f64,
    /// Depth around a point may differ by this part: more is an edge, where depth cameras guess.
    pub depth_edge: f64,
    /// Corners of a cell where points are found again by patches: a third can be measured, a tenth of those match.
    pub dense_per_cell: usize,
    /// Samples of a patch along each side: with what is around a leaf.
    pub patch_samples: usize,
    /// Distance of the samples of a patch, pixels.
    pub patch_step_px: usize,
    /// Blur before patches are taken, pixels: takes out what samples so far apart would alias.
    pub patch_blur_px: f64,
    /// Normalised cross-correlation of matched patches, at least: that of true matches from 20 cm further rarely is below.
    pub min_similarity: f64,
    /// What the best match lacks in similarity, over what the second best lacks: below this, the best is distinct.
    pub distinct: f64,
    /// How far a patch may move, in picture widths; what moves further shares too little with the keyframe.
    pub reach_across: f64,
    /// How far a patch may move, in picture heights.
    pub reach_down: f64,
}
}

impl Default for OdometryConfig {
    fn default() -> Self {
        Self {
            min_inliers: 18,
            min_share: 0.33,
            sure_inliers: 24,
            sure_share: 0.38,
            smooth_m: 0.15,
            smooth_rad: 0.15,
            enough_inliers: 60,
            keyframe_share: 0.6,
            keyframe_shift: 0.1,
            keyframe_rad: 0.15,
            wanted_inliers: 120,
            least_per_cell: 3,
            most_per_cell: 12,
            sigma_px: 0.5,
            sigma_disparity_px: 0.5,
            match_sigma_px: 1.0,
            free: 5,
            held: 3,
            gate: 16.0,
            max_steps: 6,
            nearest_m: 0.1,
            searched_m: 0.4,
            depth_baseline_m: 0.1,
            pictures: PicturesConfig::default(),
        }
    }
}

impl Default for PicturesConfig {
    fn default() -> Self {
        Self {
            flat_contrast: 3.0,
            tallest_px: 540,
            cells_across: 16,
            min_distance_px: 4,
            min_corner: 2e-4,
            edge_px: 8,
            window_px: 13,
            levels: 2,
            max_steps: 10,
            settled_px: 0.01,
            forth_and_back_px: 1.0,
            max_row_error_px: 1.5,
            min_disparity_px: 1.0,
            depth_edge: 0.05,
            dense_per_cell: 12,
            patch_samples: 13,
            patch_step_px: 3,
            patch_blur_px: 2.0,
            min_similarity: 0.5,
            distinct: 0.9,
            reach_across: 0.35,
            reach_down: 0.2,
        }
    }
}

impl OdometryConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// The setting that is outside its range.
    pub fn validate(&self) -> Result<()> {
        let positive = [
            ("odometry.smooth_m", self.smooth_m),
            ("odometry.smooth_rad", self.smooth_rad),
            ("odometry.keyframe_shift", self.keyframe_shift),
            ("odometry.keyframe_rad", self.keyframe_rad),
            ("odometry.sigma_px", self.sigma_px),
            ("odometry.sigma_disparity_px", self.sigma_disparity_px),
            ("odometry.match_sigma_px", self.match_sigma_px),
            ("odometry.gate", self.gate),
            ("odometry.nearest_m", self.nearest_m),
            ("odometry.searched_m", self.searched_m),
            ("odometry.depth_baseline_m", self.depth_baseline_m),
        ];
        for (name, value) in positive {
            require(name, value, value > 0.0 && value.is_finite(), "a positive number")?;
        }
        let shares = [
            ("odometry.min_share", self.min_share),
            ("odometry.sure_share", self.sure_share),
            ("odometry.keyframe_share", self.keyframe_share),
        ];
        for (name, value) in shares {
            require(name, value, (0.0..=1.0).contains(&value), "0 to 1")?;
        }
        let counts = [
            ("odometry.min_inliers", self.min_inliers, 4),
            ("odometry.wanted_inliers", self.wanted_inliers, 1),
            ("odometry.least_per_cell", self.least_per_cell, 1),
            ("odometry.free", self.free, 1),
            ("odometry.max_steps", self.max_steps, 1),
        ];
        for (name, value, least) in counts {
            require(name, value as f64, value >= least, &format!("at least {least}"))?;
        }
        let most = self.most_per_cell;
        let above = format!("{} to 1000", self.least_per_cell);
        require("odometry.most_per_cell", most as f64, (self.least_per_cell..=1000).contains(&most), &above)?;
        self.pictures.validate()
    }
}

impl PicturesConfig {
    fn validate(&self) -> Result<()> {
        let positive = [
            ("odometry.pictures.min_corner", self.min_corner),
            ("odometry.pictures.settled_px", self.settled_px),
            ("odometry.pictures.forth_and_back_px", self.forth_and_back_px),
            ("odometry.pictures.max_row_error_px", self.max_row_error_px),
            ("odometry.pictures.min_disparity_px", self.min_disparity_px),
            ("odometry.pictures.depth_edge", self.depth_edge),
            ("odometry.pictures.patch_blur_px", self.patch_blur_px),
            ("odometry.pictures.reach_across", self.reach_across),
            ("odometry.pictures.reach_down", self.reach_down),
        ];
        for (name, value) in positive {
            require(name, value, value > 0.0 && value.is_finite(), "a positive number")?;
        }
        let shares =
            [("odometry.pictures.min_similarity", self.min_similarity), ("odometry.pictures.distinct", self.distinct)];
        for (name, value) in shares {
            require(name, value, (0.0..=1.0).contains(&value), "0 to 1")?;
        }
        let contrast = self.flat_contrast;
        require("odometry.pictures.flat_contrast", contrast, (0.0..=128.0).contains(&contrast), "0 to 128")?;
        let counts = [
            ("odometry.pictures.tallest_px", self.tallest_px, 1, 1_000_000),
            ("odometry.pictures.cells_across", self.cells_across, 1, 1000),
            ("odometry.pictures.min_distance_px", self.min_distance_px, 1, 1000),
            ("odometry.pictures.edge_px", self.edge_px, 1, 1000),
            ("odometry.pictures.window_px", self.window_px, 3, MAX_WINDOW_PX),
            ("odometry.pictures.levels", self.levels, 0, 8),
            ("odometry.pictures.max_steps", self.max_steps, 1, 1000),
            ("odometry.pictures.dense_per_cell", self.dense_per_cell, 1, 1000),
            ("odometry.pictures.patch_samples", self.patch_samples, 3, 63),
            ("odometry.pictures.patch_step_px", self.patch_step_px, 1, 100),
        ];
        for (name, value, least, most) in counts {
            require(name, value as f64, (least..=most).contains(&value), &format!("{least} to {most}"))?;
        }
        Ok(())
    }
}

fn require(name: &'static str, value: f64, holds: bool, expected: &str) -> Result<()> {
    if holds {
        return Ok(());
    }
    Err(Error::Setting { name, reason: format!("found {value}, expected {expected}") })
}
