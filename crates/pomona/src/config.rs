//! Every setting of the core with its unit, its default and its reason, in one place.
//!
//! Lengths are metres. Where the scale is free and the clouds have no metre, lengths are stretched by the map's median
//! distance between nearest fruits over [`CLUSTER_SPACING_M`].

use crate::error::{Error, Result};
use crate::localization::LocalizationConfig;
use crate::meanings::settings;
use crate::odometry::{OdometryConfig, PicturesConfig};
use crate::paper::constellation::MAX_NEIGHBOURS;
use crate::paper::ransac::RansacConfig;
use crate::tracking::TrackingConfig;
use crate::verified::VerifiedConfig;
use serde::{Deserialize, Serialize};

/// Distance of neighbouring fruits of a cluster: about one apple, which is what the lengths below are chosen for.
pub const CLUSTER_SPACING_M: f64 = 0.08;

settings! {
/// Settings of all methods. Unknown keys are errors; missing ones keep their defaults.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Which fruits make a constellation of the paper's method.
    pub constellation: ConstellationConfig,
    /// The paper's method.
    pub paper: PaperConfig,
    /// The verified method.
    pub verified: VerifiedConfig,
    /// Fruits followed through the frames of a recording.
    pub tracking: TrackingConfig,
    /// Where the camera went, from the pictures.
    pub odometry: OdometryConfig,
    /// Where the camera is in a map.
    pub localization: LocalizationConfig,
}
}

settings! {
/// Which fruits make a constellation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ConstellationConfig {
    /// Fruits of a constellation, 4 to 7. Fewer say less each; of more, all are seen together less often. The paper: 5.
    pub k: usize,
    /// Nearest neighbours that a fruit is combined with, at least `k - 1`. More survive occlusion and cost more: C(n, k - 1)
    /// constellations per fruit. The paper: 10.
    pub n: usize,
}
}

impl Default for ConstellationConfig {
    fn default() -> Self {
        Self { k: 5, n: 10 }
    }
}

settings! {
/// The paper's method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PaperConfig {
    /// Largest distance of two matched codes, in |AB| / sqrt 3; none in the paper. The rms error of a true code is 9.6 sigma
    /// over |AB|, about 0.3 at 2 cm.
    pub max_code_distance: Option<f64>,
    /// Distance after the alignment up to which a pair agrees with it, metres. 99 % of true pairs lie within 3.4 sigma, 7 cm
    /// at a relative noise of 2 cm per axis; beyond 8 cm hangs the next fruit of the cluster.
    pub inlier_m: f64,
    /// Agreeing pairs that make an answer. Rows that share nothing gave at most 6 by chance in 60 pairs of visits, that is
    /// one false constellation and a neighbour.
    pub min_inliers: usize,
    /// Distance after the alignment up to which left-over fruits are paired, metres. The reason of `inlier_m`.
    pub completion_m: f64,
    /// Constant part of the tolerance between distances in both visits, metres: 6 sigma at 2 cm (4.2 standard deviations of
    /// a difference of two distances).
    pub clique_base_m: f64,
    /// Part of that tolerance per metre of distance: drift and sag, 1 to 3 % in recordings.
    pub clique_per_metre: f64,
    /// Work after which the largest clique found so far is taken, in 64-bit words touched; 10^8 are about 50 ms.
    pub clique_max_work: u64,
    /// How hard RANSAC looks.
    pub ransac: RansacConfig,
}
}

impl Default for PaperConfig {
    fn default() -> Self {
        Self {
            max_code_distance: None,
            inlier_m: 0.08,
            min_inliers: 10,
            completion_m: 0.08,
            clique_base_m: 0.12,
            clique_per_metre: 0.02,
            clique_max_work: 100_000_000,
            ransac: RansacConfig::default(),
        }
    }
}

impl Config {
    /// What every setting and every table means, by their names with dots between tables.
    pub fn meanings() -> impl Iterator<Item = (String, &'static str)> {
        let tables = [
            ("", Self::MEANINGS),
            ("constellation.", ConstellationConfig::MEANINGS),
            ("paper.", PaperConfig::MEANINGS),
            ("paper.ransac.", RansacConfig::MEANINGS),
            ("verified.", VerifiedConfig::MEANINGS),
            ("tracking.", TrackingConfig::MEANINGS),
            ("odometry.", OdometryConfig::MEANINGS),
            ("odometry.pictures.", PicturesConfig::MEANINGS),
            ("localization.", LocalizationConfig::MEANINGS),
        ];
        tables
            .into_iter()
            .flat_map(|(table, settings)| settings.iter().map(move |(name, is)| (format!("{table}{name}"), is.trim())))
    }

    /// Checks ranges.
    ///
    /// # Errors
    /// The first setting outside its range.
    pub fn validate(&self) -> Result<()> {
        let ConstellationConfig { k, n } = self.constellation;
        within("constellation.k", k as f64, 4.0, 7.0)?;
        within("constellation.n", n as f64, k as f64 - 1.0, MAX_NEIGHBOURS as f64)?;
        let paper = &self.paper;
        within("paper.max_code_distance", paper.max_code_distance.unwrap_or(1.0), f64::MIN_POSITIVE, f64::MAX)?;
        within("paper.inlier_m", paper.inlier_m, f64::MIN_POSITIVE, f64::MAX)?;
        within("paper.min_inliers", paper.min_inliers as f64, 3.0, f64::MAX)?;
        within("paper.completion_m", paper.completion_m, 0.0, f64::MAX)?;
        within("paper.clique_base_m", paper.clique_base_m, 0.0, f64::MAX)?;
        within("paper.clique_per_metre", paper.clique_per_metre, 0.0, 1.0)?;
        within("paper.ransac.confidence", paper.ransac.confidence, 0.0, 1.0 - f64::EPSILON)?;
        within("paper.ransac.max_samples", paper.ransac.max_samples as f64, 1.0, f64::MAX)?;
        self.verified.validate()?;
        self.tracking.validate()?;
        self.odometry.validate()?;
        self.localization.validate()
    }
}

/// `low <= value <= high`; refuses NaN.
fn within(name: &'static str, value: f64, low: f64, high: f64) -> Result<()> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    let expected = match (low, high) {
        (f64::MIN_POSITIVE, f64::MAX) => "a positive number".to_owned(),
        (low, f64::MAX) => format!("at least {low}"),
        (low, high) => format!("{low} to {high}"),
    };
    Err(Error::Setting { name, reason: format!("found {value}, expected {expected}") })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_keys_are_errors() {
        let message = toml::from_str::<Config>("[paper]\ninlier_mm = 80").unwrap_err().to_string();
        assert!(message.contains("inlier_mm"), "{message}");
    }

    #[test]
    fn every_setting_has_a_meaning() {
        fn names(table: &toml::Table, place: &str) -> Vec<String> {
            let inner = table.iter().flat_map(|(name, value)| match value {
                toml::Value::Table(inner) => names(inner, &format!("{place}{name}.")),
                _ => Vec::new(),
            });
            table.keys().map(|name| format!("{place}{name}")).chain(inner).collect()
        }
        let meanings: std::collections::HashMap<_, _> = Config::meanings().collect();
        let config = Config {
            paper: PaperConfig { max_code_distance: Some(1.0), ..PaperConfig::default() },
            ..Config::default()
        };
        let names = names(&toml::Table::try_from(config).expect("a table"), "");
        assert!(names.contains(&"paper.ransac.seed".to_owned()));
        assert_eq!(names.len(), meanings.len());
        assert!(names.iter().all(|name| !meanings[name].is_empty()), "{names:?}");
    }

    #[test]
    fn a_part_overrides_its_part() {
        let config: Config = toml::from_str("[constellation]\nk = 4").expect("valid");
        assert_eq!(config, Config { constellation: ConstellationConfig { k: 4, n: 10 }, ..Config::default() });
    }

    #[test]
    fn ranges_are_checked() {
        assert_eq!(Config::default().validate(), Ok(()));
        let config = Config { constellation: ConstellationConfig { k: 6, n: 4 }, ..Config::default() };
        let message = config.validate().unwrap_err().to_string();
        assert_eq!(message, "setting constellation.n: found 4, expected 5 to 32");
        let config =
            Config { paper: PaperConfig { inlier_m: f64::NAN, ..PaperConfig::default() }, ..Config::default() };
        assert!(config.validate().is_err());
    }
}
