//! The facade: which fruit of the query is which fruit of the map.

use crate::cloud::FruitCloud;
use crate::config::Config;
use crate::error::{Error, Result};
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

impl Match {
    /// A result without a registration.
    pub(crate) fn without_answer(verdict: Verdict, stages: Vec<(&'static str, f64)>) -> Self {
        Self { verdict, registration: None, alternatives: Vec::new(), pairs: Vec::new(), noise_m: f64::NAN, stages }
    }
}

/// A map made ready for many queries.
#[derive(Debug, Clone)]
pub struct MapIndex {
    map: FruitCloud,
    config: Config,
    method: Method,
    scale: Scale,
    prepared: Prepared,
}

#[derive(Debug, Clone)]
enum Prepared {
    Verified(Box<crate::verified::Prepared>),
}

impl MapIndex {
    /// Prepares `map` for queries by `method`.
    ///
    /// # Errors
    /// A cloud or a setting that is wrong.
    pub fn new(map: FruitCloud, method: Method, scale: Scale, config: Config) -> Result<Self> {
        map.validate()?;
        config.validate()?;
        let prepared = match method {
            Method::Verified => Prepared::Verified(Box::new(crate::verified::Prepared::new(&map, scale))),
            Method::Paper => {
                return Err(Error::Setting { name: "method", reason: "paper is not part of this build".to_owned() });
            }
        };
        Ok(Self { map, config, method, scale, prepared })
    }

    /// Finds `query` in the map.
    ///
    /// # Errors
    /// A cloud or a value that is wrong. That there is no match is no error.
    pub fn search(&self, query: &FruitCloud, noise_m: Option<f64>, up: Option<[Vector3<f64>; 2]>) -> Result<Match> {
        query.validate()?;
        let request = Request { method: self.method, scale: self.scale, noise_m, up };
        request.validate()?;
        Ok(match &self.prepared {
            Prepared::Verified(prepared) => {
                crate::verified::search(prepared, &self.map, query, &request, &self.config.verified)
            }
        })
    }
}

impl Request {
    fn validate(&self) -> Result<()> {
        if let Some(noise) = self.noise_m.filter(|noise| !(noise.is_finite() && *noise > 0.0)) {
            let reason = format!("found {noise}, expected a length above 0 m");
            return Err(Error::Setting { name: "noise_m", reason });
        }
        if self.up.iter().flatten().any(|up| !(up.norm().is_finite() && up.norm() > 0.0)) {
            let reason = "expected a finite vector that is not zero".to_owned();
            return Err(Error::Setting { name: "up", reason });
        }
        Ok(())
    }
}

/// Which fruit of `query` is which fruit of `map`.
///
/// # Errors
/// A cloud or a setting that is wrong. That there is no match is no error.
pub fn match_clouds(query: &FruitCloud, map: &FruitCloud, request: &Request, config: &Config) -> Result<Match> {
    MapIndex::new(map.clone(), request.method, request.scale, *config)?.search(query, request.noise_m, request.up)
}
