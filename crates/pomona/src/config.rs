//! Every setting of the core with its default, in one place.

use crate::error::Result;
use crate::verified::VerifiedConfig;
use serde::{Deserialize, Serialize};

/// Settings of all methods. Unknown keys are errors; missing ones keep their defaults.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// The verified method.
    pub verified: VerifiedConfig,
}

impl Config {
    /// Checks all ranges.
    ///
    /// # Errors
    /// The first setting that is outside its range.
    pub fn validate(&self) -> Result<()> {
        self.verified.validate()
    }
}
