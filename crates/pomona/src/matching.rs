//! The facade: which fruit of the query is which fruit of the map.

use crate::answer::{Match, Verdict};
use crate::cloud::FruitCloud;
use crate::conditioning::Conditioned;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::geometry::{Scale, Similarity};
use crate::verified::VerifiedMap;
use crate::verified::compact::{self, Bytes, CompactMap};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

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
    /// Relative noise of the two visits per axis, standard deviation in metres, known to a tenth or so: the verified method begins with
    /// it, the paper's takes it as it is. Estimated where `None`.
    pub noise_m: Option<f64>,
    /// The vertical in both clouds' frames, query then map, true to some 5 degrees; need not be of unit length. The paper's
    /// method does not use it.
    pub up: Option<[Vector3<f64>; 2]>,
    /// One transform for each frame of the query, their pairs merged (paper only); or one for the whole cloud.
    pub per_frame: bool,
}

/// A map made ready for many queries.
#[derive(Debug)]
pub struct MapIndex {
    map: Conditioned,
    config: Config,
    method: Method,
    scale: Scale,
    prepared: PreparedMap,
}

#[derive(Debug)]
enum PreparedMap {
    /// Fewer fruits than a constellation of the paper.
    TooFew,
    Paper(Box<crate::paper::PaperMap>),
    Verified(Box<VerifiedMap>),
    Compact(Box<CompactMap>),
}

impl MapIndex {
    /// Prepares `map` for queries by `method`.
    ///
    /// # Errors
    /// A cloud or a setting that is wrong.
    pub fn new(map: &FruitCloud, method: Method, scale: Scale, config: Config) -> Result<Self> {
        map.validate()?;
        config.validate()?;
        let given = map;
        let map = Conditioned::new(map, scale);
        if method == Method::Verified && map.cloud.len() > crate::verified::MAX_FRUITS {
            return match scale {
                Scale::Metric => Self::compacted(given, map, &config),
                Scale::Free => Err(too_many(map.cloud.len(), crate::verified::MAX_FRUITS)),
            };
        }
        let map = map.turned();
        let fruits = &map.cloud;
        let prepared = match method {
            Method::Verified => PreparedMap::Verified(Box::new(VerifiedMap::new(fruits, scale))),
            Method::Paper if fruits.len() < config.constellation.k => PreparedMap::TooFew,
            Method::Paper => PreparedMap::Paper(Box::new(crate::paper::PaperMap::new(&fruits.positions, &config)?)),
        };
        Ok(Self { map, config, method, scale, prepared })
    }

    /// Prepares `map` as a large one, whatever its size: by the verified method, metric, in a tenth of the memory, and such
    /// that it can be kept ([`Self::pieces`]).
    ///
    /// # Errors
    /// A cloud or a setting that is wrong.
    pub fn compact(map: &FruitCloud, config: Config) -> Result<Self> {
        map.validate()?;
        config.validate()?;
        Self::compacted(map, Conditioned::new(map, Scale::Metric), &config)
    }

    fn compacted(given: &FruitCloud, map: Conditioned, config: &Config) -> Result<Self> {
        if map.cloud.len() > compact::MOST {
            return Err(too_many(map.cloud.len(), compact::MOST));
        }
        let (index, map) = CompactMap::new(given, map);
        let prepared = PreparedMap::Compact(Box::new(index));
        Ok(Self { map, config: *config, method: Method::Verified, scale: Scale::Metric, prepared })
    }

    /// The compact index of `map` that was kept as `bytes`; they are read as they are needed.
    ///
    /// # Errors
    /// Bytes that are no index of this map, of another version, or damaged; a setting that is wrong.
    pub fn opened(bytes: &Bytes, map: &FruitCloud, config: Config) -> Result<Self> {
        map.validate()?;
        config.validate()?;
        let index = CompactMap::opened(bytes, map)?;
        let facts = index.facts();
        let rows = index.rows().iter().map(|&row| row as usize).collect();
        let map = Conditioned::again(map, rows, facts.middle, facts.sampled_spacing);
        let prepared = PreparedMap::Compact(Box::new(index));
        Ok(Self { map, config, method: Method::Verified, scale: Scale::Metric, prepared })
    }

    /// A compact index as the pieces of a file, in order.
    ///
    /// # Errors
    /// The index is not compact.
    pub fn pieces(&self) -> Result<impl Iterator<Item = Vec<u8>> + '_> {
        match &self.prepared {
            PreparedMap::Compact(index) => Ok(index.pieces()),
            _ => Err(Error::Index { reason: "expected a compact index: others are not kept".to_owned() }),
        }
    }

    /// Whether the index is compact.
    pub fn is_compact(&self) -> bool {
        matches!(self.prepared, PreparedMap::Compact(_))
    }

    /// Strangers in a cubic metre about each fruit of the map that was given, as the verified method has them; without end
    /// where it takes no part.
    pub(crate) fn densities(&self) -> Vec<f64> {
        let of_conditioned = match &self.prepared {
            PreparedMap::Verified(map) => map.densities(),
            PreparedMap::Compact(index) => index.densities(),
            PreparedMap::Paper(_) | PreparedMap::TooFew => Vec::new(),
        };
        self.map.given_rows(&of_conditioned, f64::INFINITY)
    }

    /// Typical distance of a fruit of the map to its sixth-nearest, metres, as the verified method has it; 0 where it takes no part.
    pub(crate) fn spacing(&self) -> f64 {
        match &self.prepared {
            PreparedMap::Verified(map) => map.spacing(),
            PreparedMap::Compact(index) => index.facts().spacing,
            PreparedMap::Paper(_) | PreparedMap::TooFew => 0.0,
        }
    }

    /// Finds `query` in the map.
    ///
    /// # Errors
    /// A cloud or a value that is wrong. That there is no match is no error.
    pub fn search(&self, query: &FruitCloud, noise_m: Option<f64>, up: Option<[Vector3<f64>; 2]>) -> Result<Match> {
        self.answer(query, &Request { method: self.method, scale: self.scale, noise_m, up, per_frame: false })
    }

    /// Finds `query` in the map frame by frame: each frame's fruits with a transform of their own, their pairs merged.
    ///
    /// # Errors
    /// As [`Self::search`]; also where the query does not know which frame saw which fruit, or the method is not the
    /// paper's.
    pub fn search_by_frame(&self, query: &FruitCloud, noise_m: Option<f64>) -> Result<Match> {
        let request = Request { method: self.method, scale: self.scale, noise_m, up: None, per_frame: true };
        self.answer(query, &request)
    }

    fn answer(&self, query: &FruitCloud, request: &Request) -> Result<Match> {
        query.validate()?;
        request.validate()?;
        let query = Conditioned::new(query, self.scale).turned();
        let up = request.up.map(|[of_query, of_map]| [query.direction(&of_query), self.map.direction(&of_map)]);
        let request = Request { noise_m: self.map.noise(request.noise_m)?, up, ..*request };
        let found = self.found(&query, &request)?;
        Ok(self.restored(&query, found))
    }

    /// The answer between the conditioned clouds.
    fn found(&self, query: &Conditioned, request: &Request) -> Result<Match> {
        let fruits = &query.cloud;
        match &self.prepared {
            PreparedMap::Verified(_) | PreparedMap::Compact(_) if fruits.len() > crate::verified::MAX_FRUITS => {
                Err(too_many(fruits.len(), crate::verified::MAX_FRUITS))
            }
            _ if !self.map.is_comparable(query) => Ok(Match::without_answer(Verdict::NoMatch, Vec::new())),
            PreparedMap::Paper(map) if fruits.len() >= self.config.constellation.k => {
                map.search(fruits, request, &self.config)
            }
            PreparedMap::Paper(_) | PreparedMap::TooFew => {
                let stages = vec![("query fruits", fruits.len() as f64), ("map fruits", self.map.cloud.len() as f64)];
                Ok(Match::without_answer(Verdict::TooFew, stages))
            }
            PreparedMap::Verified(prepared) => {
                Ok(crate::verified::search(prepared, fruits, request, &self.config.verified))
            }
            PreparedMap::Compact(index) => {
                Ok(compact::search(index, &self.map.cloud, fruits, request, &self.config.verified))
            }
        }
    }

    /// An answer between the conditioned clouds as the caller knows them, and what took no part.
    fn restored(&self, query: &Conditioned, found: Match) -> Match {
        let mut found = self.map.restored(query, found);
        let left_out = [("query_left_out", query.left_out()), ("map_left_out", self.map.left_out())];
        found.stages.extend(left_out.into_iter().filter(|side| side.1 > 0).map(|(name, count)| (name, count as f64)));
        found
    }
}

impl MapIndex {
    /// Pairs of `query` and the map under `pose`, which is known: the final stage of the verified method alone.
    ///
    /// The verdict is `Found`, `NoMatch` where the pose pairs nothing, or `TooFew` where there is next to nothing to pair;
    /// the registration is the given pose refined on the pairs.
    ///
    /// # Errors
    /// A cloud, a pose or a value that is wrong; an index of another method.
    pub fn pairs_under(&self, query: &FruitCloud, pose: &Similarity, noise_m: Option<f64>) -> Result<Match> {
        query.validate()?;
        pose.validate()?;
        let request = Request { method: self.method, scale: self.scale, noise_m, up: None, per_frame: false };
        request.validate()?;
        let query = Conditioned::new(query, self.scale).turned();
        let pose = self.map.conditioned_pose(&query, pose);
        let request = Request { noise_m: self.map.noise(noise_m)?, ..request };
        let config = &self.config.verified;
        let fruits = &query.cloud;
        let found = match &self.prepared {
            PreparedMap::Verified(prepared) => crate::verified::pairs_under(prepared, fruits, &pose, &request, config),
            PreparedMap::Compact(index) => {
                compact::pairs_under(index, &self.map.cloud, fruits, &pose, &request, config)
            }
            PreparedMap::Paper(_) | PreparedMap::TooFew => {
                let reason = "pairs under a known pose need an index of the verified method".to_owned();
                return Err(Error::Request { name: "method", reason });
            }
        };
        Ok(self.restored(&query, found))
    }
}

fn too_many(found: usize, most: usize) -> Error {
    Error::TooManyFruits { found, most }
}

/// That verticals are directions.
///
/// # Errors
/// One is zero or not finite.
pub(crate) fn require_directions(up: Option<[Vector3<f64>; 2]>) -> Result<()> {
    if up.iter().flatten().all(|up| up.norm().is_normal()) {
        return Ok(());
    }
    Err(Error::Request { name: "up", reason: "expected a finite vector that is not zero".to_owned() })
}

impl Request {
    fn validate(&self) -> Result<()> {
        if let Some(noise) = self.noise_m.filter(|noise| !(noise.is_finite() && *noise > 0.0)) {
            let reason = format!("found {noise}, expected a length above 0 m");
            return Err(Error::Request { name: "noise_m", reason });
        }
        require_directions(self.up)?;
        if self.per_frame && self.method != Method::Paper {
            // The verified method bends with the row by itself.
            let reason = "expected the paper's method".to_owned();
            return Err(Error::Request { name: "per_frame", reason });
        }
        Ok(())
    }
}

/// Which fruit of `query` is which fruit of `map`.
///
/// # Errors
/// A cloud or a setting that is wrong. That there is no match is no error.
pub fn match_clouds(query: &FruitCloud, map: &FruitCloud, request: &Request, config: &Config) -> Result<Match> {
    MapIndex::new(map, request.method, request.scale, *config)?.answer(query, request)
}

/// A cloud in metres made ready once for several matches where it is expected, as the query or as the map.
#[derive(Debug)]
pub struct ReadyCloud {
    given: Conditioned,
    prepared: VerifiedMap,
}

impl ReadyCloud {
    /// Prepares a cloud.
    ///
    /// # Errors
    /// A cloud that is wrong.
    pub fn new(cloud: &FruitCloud) -> Result<Self> {
        cloud.validate()?;
        let given = Conditioned::new(cloud, Scale::Metric).turned();
        let prepared = VerifiedMap::without_seeds(&given.cloud);
        Ok(Self { given, prepared })
    }
}

/// Which fruit of `query` is which fruit of `map`, where the pose is known to a few decimetres: as the verified method
/// says it, at half the cost. `NoMatch` where that leaves any doubt, as it does where little is shared: then search.
///
/// # Errors
/// A pose, a value or a setting that is wrong.
pub fn match_expected(
    query: &ReadyCloud,
    map: &ReadyCloud,
    map_from_query: &Similarity,
    noise_m: Option<f64>,
    config: &Config,
) -> Result<Match> {
    config.validate()?;
    map_from_query.validate()?;
    let [(query, query_ready), (map, map_ready)] = [query, map].map(|ready| (&ready.given, &ready.prepared));
    let request = Request { noise_m: map.noise(noise_m)?, ..Request::default() };
    request.validate()?;
    if !map.is_comparable(query) {
        return Ok(Match::without_answer(Verdict::NoMatch, Vec::new()));
    }
    let pose = map.conditioned_pose(query, map_from_query);
    let found = crate::verified::search_expected(query_ready, map_ready, &pose, &request, &config.verified);
    Ok(map.restored(query, found))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verified::MAX_FRUITS;
    use nalgebra::Point3;

    #[test]
    fn more_fruits_than_the_verified_method_holds_are_no_wrong_setting() {
        let place = |row: usize| Point3::new((row % 1000) as f64, (row / 1000) as f64, 0.0);
        let many = FruitCloud::from_positions((0..=MAX_FRUITS).map(place).collect());
        let refused = MapIndex::new(&many, Method::Verified, Scale::Free, Config::default());
        assert_eq!(refused.err(), Some(Error::TooManyFruits { found: MAX_FRUITS + 1, most: MAX_FRUITS }));
    }

    #[test]
    fn what_is_wrong_with_a_request_is_said_of_the_request() {
        let cloud = FruitCloud::from_positions(vec![Point3::origin(); 3]);
        let ask = |request: &Request| match_clouds(&cloud, &cloud, request, &Config::default()).map(|_| ());
        let named = |answer| matches!(answer, Err(Error::Request { name, .. }) if name == "noise_m");
        assert!(named(ask(&Request { noise_m: Some(-1.0), ..Request::default() })));
        let up = Request { up: Some([Vector3::zeros(); 2]), ..Request::default() };
        assert_eq!(ask(&up).unwrap_err().to_string(), "up: expected a finite vector that is not zero");
    }

    #[test]
    fn a_pose_that_is_none_is_refused_and_one_that_is_far_off_pairs_nothing() {
        let place =
            |row: usize| Point3::new((row % 12) as f64 * 0.31, (row / 12) as f64 * 0.27, (row * row % 7) as f64 * 0.1);
        let cloud = FruitCloud::from_positions((0..60).map(place).collect());
        let index =
            MapIndex::new(&cloud, Method::Verified, Scale::Metric, Config::default()).expect("a map of 60 fruits");
        let under = |pose: &Similarity| index.pairs_under(&cloud, pose, None);
        let here = Similarity::identity();
        assert_eq!(under(&here).expect("a pose").verdict, Verdict::Found);
        for scale in [f64::NAN, 0.0, -1.0, f64::INFINITY] {
            assert!(matches!(under(&Similarity { scale, ..here }), Err(Error::Similarity { .. })), "{scale}");
        }
        let far = |x: f64| Similarity { translation: Vector3::new(x, 0.0, 0.0), ..here };
        assert!(matches!(under(&far(f64::NAN)), Err(Error::Similarity { .. })));
        let found = under(&far(100.0)).expect("a pose");
        assert_eq!((found.verdict, found.pairs.len()), (Verdict::NoMatch, 0));
    }
}
