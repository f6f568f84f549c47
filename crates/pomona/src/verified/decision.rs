//! The story of one query: seeds, hypotheses, growth, acceptance, pairs.

use super::acceptance::{VerifiedConfig, poses};
use super::association::associate;
use super::growth::{Overlap, grow, grow_everywhere, settle};
use super::hypothesis::{Hypothesis, Model, Scratch, refine};
use super::landscape::Landscape;
use super::outline;
use super::pose::{Moments, Pose};
use super::search::{Candidate, Effort, refined, round};
use super::seeds::SeedIndex;
use super::size::Sizes;
use crate::cloud::FruitCloud;
use crate::geometry::{Scale, Similarity};
use crate::matching::{Match, Pair, Registration, Request, Verdict};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Fruits below which there is no answer: a seed of four and one that speaks for it.
const MIN_FRUITS: usize = 5;

/// Fruits of one cloud at the most: the map's seeds take some 10 kB a fruit.
pub(crate) const MAX_FRUITS: usize = 300_000;

/// Noise in spacings that seeds are searched with: 2 cm in an orchard.
const SEED_SIGMA: f64 = 0.075;

/// Probability that a fruit is seen again, while poses are compared; the pairs estimate their own.
const DETECTION: f64 = 0.55;

/// Outlines sharper than this many spacings of noise are refined cell by cell.
const SHARP: f64 = 0.18;

/// Rounds of the search: seeds per fruit up to which they go, and candidates that are refined.
const ROUNDS: [(u64, usize); 4] = [(1, 32), (1, 32), (4, 48), (u64::MAX, 64)];

/// Fruits whose seeds make the first round: where the visits overlap well, few are enough in a cloud of any size.
const FIRST_FRUITS: usize = 256;

/// Small clouds try at least this many seeds: all of them in a cloud of twelve.
const FEW_SEEDS: u64 = 1500;

/// Hypotheses of a round that are grown.
const GROWN: usize = 6;

/// A rival with this share of the best evidence makes the answer ambiguous.
const RIVAL: f64 = 0.55;

/// Candidates that are refined in search of a rival once a pose is accepted.
const RIVAL_CANDIDATES: usize = 24;

/// Two hypotheses that put a fruit within this many spacings of one place are the same.
const SAME: f64 = 0.4;

/// Times more seeds where the vertical is known.
const UPRIGHT_SEEDS: u64 = 4;

/// How far the vertical of a pose may lean from the one given: 10 degrees.
const MAX_LEAN_RAD: f64 = 0.175;

/// A map made ready for many queries.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    landscape: Landscape,
    seeds: SeedIndex,
    scale: Scale,
}

impl Prepared {
    pub(crate) fn new(map: &FruitCloud, scale: Scale) -> Self {
        let landscape = Landscape::new(map);
        let seeds = SeedIndex::new(&landscape, scale, 6.0 * SEED_SIGMA * landscape.spacing);
        Self { landscape, seeds, scale }
    }
}

/// An overlap with the region it was found from.
struct Finding {
    overlap: Overlap,
    seed: Hypothesis,
    /// What growth assumed.
    model: Model,
}

/// Finds the query in the map.
pub(crate) fn search(
    prepared: &Prepared,
    map: &FruitCloud,
    query: &FruitCloud,
    request: &Request,
    config: &VerifiedConfig,
) -> Match {
    if query.len() < MIN_FRUITS || map.len() < MIN_FRUITS {
        return Match::without_answer(Verdict::TooFew, vec![("fruits_needed", MIN_FRUITS as f64)]);
    }
    let search = Search::new(prepared, query, request, config);
    let (mut findings, mut stages) = search.run();
    if findings.first().is_some_and(|best| search.fits_better_mirrored(best)) {
        stages.push(("mirrored", 1.0));
        findings.clear();
    }
    if let Some(best) = findings.first_mut() {
        search.reach_all(best);
    }
    search.answer(findings, map, query, stages)
}

/// Fruits within this many standard deviations of one line fix no turn about it.
const FLAT: f64 = 3.0;

/// How much more a mirror image must explain to rule a pose out; on a plane both explain the same.
const MIRRORED: f64 = 1.3;

/// A pose that explains this share of the query is no accident of a flat crown.
const WHOLE: f64 = 0.7;

/// A pose with this many times the evidence needed is no local optimum.
const SURE: f64 = 6.0;

/// Times that turned starts are tried.
const POLISHES: usize = 3;

/// Radius in spacings of the region that decides between turned starts.
const POLISH_REACH: f64 = 5.0;

/// The pose, and the pose turned about `middle` by 5 and 10 degrees either way about each axis of the map.
fn turned(pose: &Pose, middle: &Vector3<f64>) -> impl Iterator<Item = Pose> {
    let (pose, middle) = (*pose, *middle);
    let fixed = pose.apply(&middle);
    let turns = [-0.175, -0.087, 0.087, 0.175].into_iter().flat_map(|angle| {
        [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| Rotation3::new(axis * angle).into_inner())
    });
    std::iter::once(Matrix3::identity()).chain(turns).map(move |turn| {
        let rotation = turn * pose.rotation;
        Pose { rotation, translation: fixed - rotation * middle * pose.scale, scale: pose.scale }
    })
}

/// Pairs of two clouds whose pose is known: the final stage alone.
pub(crate) fn pairs_under(
    prepared: &Prepared,
    map: &FruitCloud,
    query: &FruitCloud,
    map_from_query: &Similarity,
    request: &Request,
    config: &VerifiedConfig,
) -> Match {
    let search = Search::new(prepared, query, request, config);
    let pose = Pose::from_similarity(map_from_query, &search.query.centre, &search.map.centre);
    let sigma = request.noise_m.unwrap_or(search.model.sigma);
    let place = search.query.points.first().copied().unwrap_or_default();
    let seed = Hypothesis { pose, log_odds: f64::NAN, place, sigma };
    let model = Model { sigma, ..search.model };
    let overlap = settle(&search.query, search.map, &seed, &model);
    search.answer(vec![Finding { overlap, seed, model }], map, query, Vec::new())
}

struct Search<'a> {
    query: Landscape,
    map: &'a Landscape,
    seeds: &'a SeedIndex,
    model: Model,
    config: VerifiedConfig,
    up: Option<[Vector3<f64>; 2]>,
}

type Stages = Vec<(&'static str, f64)>;

impl<'a> Search<'a> {
    fn new(prepared: &'a Prepared, query: &FruitCloud, request: &Request, config: &VerifiedConfig) -> Self {
        let map = &prepared.landscape;
        let sigma = request.noise_m.unwrap_or(SEED_SIGMA * map.spacing).max(0.2 * SEED_SIGMA * map.spacing);
        Self {
            query: Landscape::new(query),
            map,
            seeds: &prepared.seeds,
            model: Model {
                sigma: sigma.min(2.0 * SEED_SIGMA * map.spacing),
                detection: DETECTION,
                scale: prepared.scale,
            },
            config: *config,
            up: request.up.map(|pair| pair.map(|up| up.normalize())),
        }
    }

    fn threshold(&self) -> f64 {
        // The cap of directions within the lean, over the sphere.
        let share = if self.up.is_some() { (1.0 - MAX_LEAN_RAD.cos()) / 2.0 } else { 1.0 };
        self.config.threshold(poses(self.query.len(), self.map.len(), self.model.scale, share))
    }

    fn admits(&self, pose: &Pose) -> bool {
        self.up.is_none_or(|[query, map]| (pose.rotation * query).dot(&map) > MAX_LEAN_RAD.cos())
    }

    /// Rounds of seeds until a pose is accepted, then the outline.
    fn run(&self) -> (Vec<Finding>, Stages) {
        let mut effort = Effort::default();
        // A known vertical rules most candidates out at once, so that more seeds cost no more.
        let seeds = self.config.seeds_per_fruit * if self.up.is_some() { UPRIGHT_SEEDS } else { 1 };
        let last = seeds.max(FEW_SEEDS / self.query.len() as u64).min(u64::from(u32::MAX));
        let threshold = self.threshold();
        let mut turn = 0;
        let mut best: Option<f64> = None;
        let mut findings = Vec::new();
        let (mut tried, mut grown) = (0, 0);
        for (index, (turns, keep)) in ROUNDS.into_iter().enumerate() {
            let end = turns.min(last);
            let admits = |pose: &Pose| self.admits(pose);
            let stride = if index == 0 { self.query.len().div_ceil(FIRST_FRUITS) as u64 } else { 1 };
            let which = (stride, turn..end);
            let (hypotheses, rest, spent) = round(&self.query, self.map, self.seeds, &self.model, &admits, which, keep);
            turn = if stride == 1 { end } else { 0 };
            effort = effort + spent;
            tried += hypotheses.len();
            grown += self.grow_distinct(&hypotheses, &mut findings);
            for finding in &findings {
                best = Some(best.map_or(finding.overlap.log_odds, |b| b.max(finding.overlap.log_odds)));
            }
            findings.retain(|finding| finding.overlap.log_odds > threshold && self.turns_are_fixed(finding));
            if !findings.is_empty() {
                grown += self.look_for_rivals(&rest, &mut findings);
                findings.retain(|finding| finding.overlap.log_odds > threshold && self.turns_are_fixed(finding));
                for finding in &mut findings {
                    if finding.overlap.log_odds < SURE * threshold {
                        self.polish(finding);
                    }
                }
                break;
            }
            // After the first round, before the long ones: what shows the same trees is found here at any noise.
            let outline = (index == 1).then(|| self.by_outline()).flatten();
            if let Some(found) = outline.filter(|found| self.turns_are_fixed(found)) {
                findings.push(found);
                break;
            }
        }
        findings.sort_by(|a, b| b.overlap.log_odds.total_cmp(&a.overlap.log_odds));
        let stages = vec![
            ("query_fruits", self.query.len() as f64),
            ("map_fruits", self.map.len() as f64),
            ("map_seeds", self.seeds.quads.len() as f64),
            ("query_codes", effort.codes as f64),
            ("candidates", effort.candidates as f64),
            ("fitted", effort.fitted as f64),
            ("refined", tried as f64),
            ("grown", f64::from(grown)),
            ("threshold_nats", threshold),
            ("best_nats", best.unwrap_or(f64::NAN)),
            ("verified", findings.len() as f64),
        ];
        (findings, stages)
    }

    /// Grows the best hypotheses that no finding explains yet; returns how many.
    fn grow_distinct(&self, hypotheses: &[Hypothesis], findings: &mut Vec<Finding>) -> u32 {
        let mut grown = 0;
        for seed in hypotheses {
            if grown as usize == GROWN {
                break;
            }
            if findings.iter().any(|finding| self.explains(finding, &seed.place, &seed.pose)) {
                continue;
            }
            let overlap = grow(&self.query, self.map, seed, &self.model);
            grown += 1;
            findings.push(Finding { overlap, seed: *seed, model: self.model });
        }
        grown
    }

    /// Grows what the candidates that no finding explains propose: a second tree that looks the same has seeds too, but
    /// the true one may have more of the best.
    fn look_for_rivals(&self, rest: &[Candidate], findings: &mut Vec<Finding>) -> u32 {
        let others: Vec<Candidate> = rest
            .iter()
            .filter(|candidate| {
                !findings.iter().any(|finding| self.explains(finding, &candidate.place, &candidate.pose))
            })
            .take(RIVAL_CANDIDATES)
            .copied()
            .collect();
        self.grow_distinct(&refined(&self.query, self.map, &others, &self.model), findings)
    }

    /// Whether a finding puts the fruits around the seed where the seed puts them.
    fn explains(&self, finding: &Finding, place: &Vector3<f64>, pose: &Pose) -> bool {
        let reach = SAME * self.query.spacing;
        let mut near = Vec::new();
        self.query.tree.nearest(&super::landscape::single(place), 8, &mut near);
        let same = near
            .iter()
            .filter(|(row, _)| {
                let p = self.query.points[*row as usize];
                let found = match finding.overlap.predictions[*row as usize] {
                    Some(prediction) => prediction.place,
                    None => finding.seed.pose.apply(&p),
                };
                (found - pose.apply(&p)).norm() < reach * pose.scale
            })
            .count();
        2 * same > near.len()
    }

    /// Sums over the fruits of the overlap and their predictions.
    fn overlap_moments(&self, finding: &Finding) -> Moments {
        let mut moments = Moments::default();
        for (p, prediction) in self.query.points.iter().zip(&finding.overlap.predictions) {
            if let Some(at) = prediction {
                moments.add(p, &at.place, 1.0);
            }
        }
        moments
    }

    /// Whether the fruits of the overlap leave the line: on a line the turn about it, and its direction, stay open.
    fn turns_are_fixed(&self, finding: &Finding) -> bool {
        let moments = self.overlap_moments(finding);
        if moments.weight <= 0.0 {
            return false;
        }
        let mut spread = moments.spread().symmetric_eigenvalues();
        spread.as_mut_slice().sort_by(f64::total_cmp);
        let noise = finding.overlap.sigma / finding.overlap.pose.scale;
        spread[1] > FLAT * FLAT * noise * noise
    }

    /// Whether the mirror image of the query, laid on the same fruits, explains more than the query does.
    ///
    /// Where a crown is flat, a mirrored row matches by a half-turn; the rest of the row tells.
    fn fits_better_mirrored(&self, finding: &Finding) -> bool {
        let explained = finding.overlap.predictions.iter().flatten().count();
        if explained as f64 > WHOLE * self.query.len() as f64 {
            return false;
        }
        let moments = self.overlap_moments(finding);
        let eigen = moments.spread().symmetric_eigen();
        let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        let Overlap { pose, middle, sigma, log_odds, .. } = finding.overlap;
        let rotation = pose.rotation * (Matrix3::identity() - normal * normal.transpose() * 2.0);
        let translation = pose.apply(&middle) - rotation * middle * pose.scale;
        let seed =
            Hypothesis { pose: Pose { rotation, translation, scale: pose.scale }, place: middle, sigma, log_odds };
        let model = finding.model;
        let mut mirrored = Finding { overlap: grow(&self.query, self.map, &seed, &model), seed, model };
        self.polish(&mut mirrored);
        mirrored.overlap.log_odds > MIRRORED * log_odds
    }

    /// Tries to leave the local optimum of a finding: turned starts, refined and grown; the best evidence wins.
    ///
    /// A seed half a metre wide is turned by a few degrees by its noise. In a crown where fruits hang 8 cm apart the
    /// fruits a metre away then meet their neighbours, and the refinement can settle there.
    fn polish(&self, finding: &mut Finding) {
        let mut scratch = Scratch::default();
        for _ in 0..POLISHES {
            let Overlap { pose, middle, sigma, .. } = finding.overlap;
            let model = Model { sigma, ..self.model };
            let best = turned(&pose, &middle)
                .filter_map(|start| {
                    refine(
                        &self.query,
                        self.map,
                        &start,
                        &middle,
                        POLISH_REACH * self.query.spacing,
                        &model,
                        &mut scratch,
                    )
                })
                .max_by(|a, b| a.log_odds.total_cmp(&b.log_odds));
            let Some(seed) = best else { return };
            let overlap = grow(&self.query, self.map, &seed, &finding.model);
            if overlap.log_odds < finding.overlap.log_odds + 0.5 {
                return;
            }
            *finding = Finding { overlap, seed, model: finding.model };
        }
    }

    /// Adds the crowns that growth did not reach; only the finding that is reported needs them.
    fn reach_all(&self, finding: &mut Finding) {
        if finding.seed.sigma >= SHARP * self.map.spacing {
            return; // settled on the whole query already
        }
        let log_odds = finding.overlap.log_odds;
        finding.overlap = grow_everywhere(&self.query, self.map, &finding.seed, &finding.model);
        finding.overlap.log_odds = log_odds;
    }

    fn by_outline(&self) -> Option<Finding> {
        let seed = outline::hypothesis(&self.query, self.map, self.model.scale, &|pose| self.admits(pose))?;
        let model = Model { sigma: seed.sigma, ..self.model };
        let mut overlap = if seed.sigma < SHARP * self.map.spacing {
            grow(&self.query, self.map, &seed, &model)
        } else {
            settle(&self.query, self.map, &seed, &model)
        };
        overlap.log_odds = overlap.log_odds.max(seed.log_odds);
        Some(Finding { overlap, seed, model })
    }

    fn answer(&self, mut findings: Vec<Finding>, map: &FruitCloud, query: &FruitCloud, mut stages: Stages) -> Match {
        if findings.is_empty() {
            return Match::without_answer(Verdict::NoMatch, stages);
        }
        let best = findings.remove(0);
        let rivals: Vec<Registration> = findings
            .iter()
            .filter(|f| f.overlap.log_odds > RIVAL * best.overlap.log_odds && self.contradict(&best, f))
            .map(|f| self.registration(f))
            .collect();
        let sizes = Sizes::new(query, map, &self.query, self.map);
        let mut pairs = associate(&self.query, self.map, &best.overlap, &|_, _| 1.0, self.config.min_probability);
        if let Some(cue) = sizes.and_then(|sizes| sizes.cue(&pairs)) {
            let size = |q: u32, m: u32| cue.ratio(q, m);
            pairs = associate(&self.query, self.map, &best.overlap, &size, self.config.min_probability);
        }
        let mut pairs: Vec<Pair> = pairs
            .iter()
            .map(|pair| Pair {
                query: self.query.rows[pair.query as usize] as usize,
                map: self.map.rows[pair.map as usize] as usize,
                probability: pair.probability,
                distance_m: pair.distance,
                support: pair.gain,
            })
            .collect();
        pairs.sort_unstable_by_key(|pair| pair.query);
        stages.push(("pairs", pairs.len() as f64));
        Match {
            verdict: if rivals.is_empty() { Verdict::Found } else { Verdict::Ambiguous },
            registration: Some(self.registration(&best)),
            alternatives: rivals,
            pairs,
            noise_m: best.overlap.sigma,
            stages,
        }
    }

    fn registration(&self, finding: &Finding) -> Registration {
        Registration {
            map_from_query: finding.overlap.pose.to_similarity(&self.query.centre, &self.map.centre),
            log_odds: finding.overlap.log_odds,
        }
    }

    /// Whether two findings explain the same fruits of the query by different fruits of the map.
    fn contradict(&self, a: &Finding, b: &Finding) -> bool {
        let both = a.overlap.predictions.iter().zip(&b.overlap.predictions);
        let shared: Vec<bool> = both
            .filter_map(|pair| match pair {
                (Some(x), Some(y)) => Some((x.place - y.place).norm() > 0.5 * self.map.spacing),
                _ => None,
            })
            .collect();
        let claimed = b.overlap.predictions.iter().flatten().count().max(1);
        2 * shared.iter().filter(|&&apart| apart).count() > claimed.min(shared.len().max(claimed / 2))
    }
}
