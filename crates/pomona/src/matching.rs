//! The facade: which fruit of the query is which fruit of the map.

use crate::geometry::{Scale, Similarity};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// What a match says. All four are results, none is an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// One registration stands out and its pairs are reported.
    Found,
    /// Fewer fruits than a constellation needs.
    TooFew,
    /// Several different registrations explain the clouds equally well; they are reported as alternatives.
    Ambiguous,
    /// No registration explains the clouds better than chance.
    NoMatch,
}

/// Which method decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Votes of STaR-i codes, assignment, RANSAC, clique: the paper, section III.
    Paper,
    /// Constellations verified by log-odds.
    #[default]
    Verified,
}

/// What the caller knows of one pair of clouds.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Request {
    /// Which method decides.
    pub method: Method,
    /// Whether both clouds are in metres.
    pub scale: Scale,
    /// Relative noise of the two visits per axis, standard deviation in metres; estimated where `None`.
    pub noise_m: Option<f64>,
    /// The vertical in both clouds' frames, query then map; need not be of unit length.
    pub up: Option<[Vector3<f64>; 2]>,
}

/// One fruit found again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Row in the query.
    pub query: usize,
    /// Row in the map.
    pub map: usize,
    /// Probability that the two are one fruit.
    pub probability: f64,
    /// Distance after the registration that the pair belongs to, metres of the map.
    pub distance_m: f64,
    /// What speaks for the pair: votes of constellations (paper) or log-odds in nats (verified).
    pub support: f64,
}

/// A registration with its evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// Takes points of the query into the map.
    pub map_from_query: Similarity,
    /// Evidence against chance, nats.
    pub log_odds: f64,
}

/// The answer to one query.
#[derive(Debug, Clone, PartialEq)]
pub struct Match {
    /// What the match says.
    pub verdict: Verdict,
    /// The registration; `None` for `TooFew` and `NoMatch`.
    pub registration: Option<Registration>,
    /// Other registrations as good as the first; empty unless `Ambiguous`.
    pub alternatives: Vec<Registration>,
    /// Fruits found again, sorted by query row; one to one.
    pub pairs: Vec<Pair>,
    /// Relative noise per axis in metres, as given or as estimated; NaN where nothing was found.
    pub noise_m: f64,
    /// What happened, stage by stage: name and count, for `--explain`.
    pub stages: Vec<(&'static str, f64)>,
}
