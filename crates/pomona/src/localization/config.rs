//! Settings of localisation.

use crate::error::{Error, Result};
use crate::meanings::settings;
use serde::{Deserialize, Serialize};

settings! {
/// Where the camera is in a map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LocalizationConfig {
    /// How far a fruit hangs from where the map has it, each for itself: standard deviation per axis, metres.
    pub own_m: f64,
    /// How far all fruits in view hang from there together, by sag and drift: standard deviation per axis, metres.
    pub shared_m: f64,
    /// Part of that across the vertical, where it is known: branches sag.
    pub sideways: f64,
    /// Distance over which neighbours move together besides, metres; how far, their residuals show.
    pub reach_m: f64,
    /// Sightings from which on a frame stands alone; with fewer, the frames before are taken too.
    pub enough_fruits: usize,
    /// Frames that are taken together at the most.
    pub window_frames: usize,
    /// Probability that a pose which is followed is kept though the fruits around it are strangers.
    pub false_alarm_rate: f64,
}
}

impl Default for LocalizationConfig {
    fn default() -> Self {
        Self {
            own_m: 0.01,
            // Rendered rows of one to five weeks: what all fruits in view share is 0.3 to 2 cm.
            shared_m: 0.008,
            // On those rows 3 mm across the vertical and 10 mm along it.
            sideways: 0.5,
            // Half the spread of a branch.
            reach_m: 0.5,
            enough_fruits: 25,
            window_frames: 8,
            false_alarm_rate: 1e-4,
        }
    }
}

impl LocalizationConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// The setting that is outside its range.
    pub fn validate(&self) -> Result<()> {
        let wrong = |name, reason: &str| Err(Error::Setting { name, reason: reason.to_owned() });
        let lengths = [
            ("localization.own_m", self.own_m),
            ("localization.shared_m", self.shared_m),
            ("localization.reach_m", self.reach_m),
        ];
        for (name, length_m) in lengths {
            if !(length_m > 0.0 && length_m.is_finite()) {
                return wrong(name, "expected a length above 0 m");
            }
        }
        if !(self.sideways > 0.0 && self.sideways <= 1.0) {
            return wrong("localization.sideways", "expected a part above 0, at most 1");
        }
        if self.window_frames == 0 {
            return wrong("localization.window_frames", "found 0, expected at least 1");
        }
        if !(self.false_alarm_rate > 0.0 && self.false_alarm_rate < 1.0) {
            return wrong("localization.false_alarm_rate", "expected a probability between 0 and 1");
        }
        Ok(())
    }
}
