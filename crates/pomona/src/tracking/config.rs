//! Settings of the tracker.

use crate::error::{Error, Result};
use crate::meanings::settings;
use serde::{Deserialize, Serialize};

/// Part of the noise of a pose that is left when some fifteen fruits have corrected it: one over the square root.
const LEFT_BY_ALIGNMENT: f64 = 0.25;

settings! {
/// How fruits are tracked through one visit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrackingConfig {
    /// Frames that must have seen a fruit for it to be reported.
    pub min_views: usize,
    /// Frames after which a frame is assigned once more, and for good.
    pub lag: usize,
    /// Standard deviation of one edge of a box, pixels.
    pub edge_sigma_px: f64,
    /// Boxes of fruits never seen before in one frame, on average.
    pub new_per_frame: f64,
    /// Boxes in one frame that show no fruit, on average.
    pub false_per_frame: f64,
    /// Probability that a fruit in the picture is found.
    pub detection_probability: f64,
    /// Probability that the depth of a box is not the fruit's, before it is learned.
    pub depth_outliers: f64,
    /// Mean part of its size that a partly hidden fruit lacks.
    pub hidden_mean: f64,
    /// Noise of the given poses between neighbouring frames: place, metres.
    pub pose_sigma_m: f64,
    /// Noise of the given poses between neighbouring frames: direction, radians.
    pub pose_sigma_rad: f64,
    /// Drift of the camera's place over the way since a fruit was last seen.
    pub drift_per_metre: f64,
    /// Largest drift that is allowed for, metres.
    pub max_drift_m: f64,
    /// Distance of two touching fruits' centres over the sum of their radii, at least.
    pub solid: f64,
    /// Log-odds above which two fruits are taken for one, nats.
    pub merge_log_odds: f64,
}
}

impl Default for TrackingConfig {
    fn default() -> Self {
        Self {
            // The paper's; a box that shows no fruit does not come five times to one place.
            min_views: 5,
            // Longer than a fruit stays in view at walking pace and 30 frames a second: two metres at a metre a second.
            // After that nothing more is learned about it. A hundred frames are some megabytes.
            lag: 100,
            // Half a pixel of rounding, and what people and detectors disagree by on a clear outline.
            edge_sigma_px: 1.0,
            // Some thirty fruits come up on a metre of way, 0.15 m a frame; only the logarithm counts.
            new_per_frame: 5.0,
            // A tenth of forty boxes.
            false_per_frame: 4.0,
            // Leaves hide a fruit in about every second frame.
            detection_probability: 0.5,
            // Between a depth camera's 1 % and the half of a poor stereo pair's. It is learned within some frames.
            depth_outliers: 0.2,
            // Boxes around what is seen of fruits that show 30 to 90 % of their face lack a fifth of the width.
            hidden_mean: 0.2,
            // Poor visual odometry over a step of 0.2 m: 4 % and 0.2 degrees, 2 px each at 1.5 m. Fruits correct it.
            pose_sigma_m: 0.008,
            pose_sigma_rad: 0.0035,
            // What the odometry of this package reaches on a row, and public ones on roads.
            drift_per_metre: 0.01,
            // Half of a small fruit: with more, a place says no longer which fruit of a cluster is meant.
            max_drift_m: 0.02,
            // Calipers on two diameters of an apple differ by 2-5 %, outlines by 10 %.
            solid: 0.8,
            // A wrong merge loses a fruit, a missed one counts it twice: alike; 3 nats are 20 to 1.
            merge_log_odds: 3.0,
        }
    }
}

impl TrackingConfig {
    /// The same where fruits have said where the camera is.
    pub(crate) fn with_aligned_poses(self) -> Self {
        Self {
            pose_sigma_m: LEFT_BY_ALIGNMENT * self.pose_sigma_m,
            pose_sigma_rad: LEFT_BY_ALIGNMENT * self.pose_sigma_rad,
            ..self
        }
    }

    /// Standard deviation of the camera's place after a way, metres.
    pub(crate) fn drift_m(&self, way_m: f64) -> f64 {
        (self.drift_per_metre * way_m).min(self.max_drift_m)
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// The setting that is outside its range.
    pub fn validate(&self) -> Result<()> {
        let positive = [
            ("tracking.edge_sigma_px", self.edge_sigma_px),
            ("tracking.new_per_frame", self.new_per_frame),
            ("tracking.false_per_frame", self.false_per_frame),
            ("tracking.hidden_mean", self.hidden_mean),
            ("tracking.solid", self.solid),
        ];
        for (name, value) in positive {
            require(name, value, value > 0.0 && value.is_finite(), "a positive number")?;
        }
        let not_negative = [
            ("tracking.pose_sigma_m", self.pose_sigma_m),
            ("tracking.pose_sigma_rad", self.pose_sigma_rad),
            ("tracking.drift_per_metre", self.drift_per_metre),
            ("tracking.max_drift_m", self.max_drift_m),
        ];
        for (name, value) in not_negative {
            require(name, value, value >= 0.0 && value.is_finite(), "0 or more")?;
        }
        let probabilities = [
            ("tracking.detection_probability", self.detection_probability),
            ("tracking.depth_outliers", self.depth_outliers),
        ];
        for (name, value) in probabilities {
            require(name, value, value > 0.0 && value < 1.0, "a probability between 0 and 1")?;
        }
        require("tracking.merge_log_odds", self.merge_log_odds, self.merge_log_odds.is_finite(), "a finite number")?;
        require("tracking.lag", self.lag as f64, self.lag > 0, "at least 1")?;
        require("tracking.min_views", self.min_views as f64, self.min_views > 0, "at least 1")
    }
}

fn require(name: &'static str, value: f64, holds: bool, expected: &str) -> Result<()> {
    if holds {
        return Ok(());
    }
    Err(Error::Setting { name, reason: format!("found {value}, expected {expected}") })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_checked() {
        assert_eq!(TrackingConfig::default().validate(), Ok(()));
        let wrong = TrackingConfig { min_views: 0, ..TrackingConfig::default() };
        assert_eq!(
            wrong.validate().unwrap_err().to_string(),
            "setting tracking.min_views: found 0, expected at least 1"
        );
        assert!(TrackingConfig { solid: f64::NAN, ..TrackingConfig::default() }.validate().is_err());
        assert!(TrackingConfig { depth_outliers: 1.0, ..TrackingConfig::default() }.validate().is_err());
    }
}
