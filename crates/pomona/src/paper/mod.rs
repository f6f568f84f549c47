//! The paper's method, whole clouds and frame by frame (the paper, section III-C).
//!
//! 1. Constellations of the query find the nearest code of the map ([`mod@codebook`]).
//! 2. Each votes for its fruit pairs ([`voting`]); an assignment makes them one to one ([`crate::assignment`]).
//! 3. RANSAC and Procrustes find the transform that most pairs agree on ([`mod@ransac`]).
//! 4. Fruits left over are paired with their nearest neighbour after the alignment ([`completion`]).
//! 5. A maximum clique keeps the pairs whose distances agree in both clouds ([`clique`]).
//!
//! Frame by frame, each frame's fruits go through these steps alone and get a transform of their own, because no single
//! rigid transform fits a long row; an assignment by the number of frames that saw a pair merges them.

pub mod clique;
pub mod codebook;
pub mod completion;
pub mod constellation;
pub mod descriptor;
mod pair_odds;
pub mod ransac;
pub mod voting;

use self::clique::{Tolerance, largest_consistent};
use self::codebook::{Ballot, Codebook, codebook};
use self::completion::complete;
use self::pair_odds::PairOdds;
use self::ransac::ransac;
use crate::answer::{Match, Pair, Registration, Verdict};
use crate::assignment::assign;
use crate::cloud::FruitCloud;
use crate::config::{CLUSTER_SPACING_M, Config, PaperConfig};
use crate::error::{Error, Result};
use crate::geometry::{Scale, Similarity};
use crate::matching::Request;
use crate::neighbours::index::Index;
use nalgebra::Point3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Constellations of one cloud at most: 10^8 with their codes take 8 GB.
const MAX_CONSTELLATIONS: usize = 100_000_000;

/// A map prepared for many queries.
#[derive(Debug)]
pub(crate) struct PaperMap {
    fruits: Ordered,
    codes: Box<dyn Codebook>,
    /// Median distance of a fruit from its nearest neighbour, metres.
    spacing_m: f64,
    evidence: PairOdds,
}

/// Fruits ordered by place, so that the order of the input rows cannot touch the answer.
#[derive(Debug)]
struct Ordered {
    positions: Vec<Point3<f64>>,
    /// Row of the input of each place.
    rows: Vec<usize>,
}

impl Ordered {
    fn new(positions: &[Point3<f64>]) -> Self {
        let mut rows: Vec<_> = (0..positions.len()).collect();
        let key = |row: usize| positions[row].coords.data.0[0];
        rows.sort_by(|&a, &b| {
            let (a, b) = (key(a), key(b));
            a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2]))
        });
        Self { positions: rows.iter().map(|&row| positions[row]).collect(), rows }
    }

    /// Ascending places of rows of the input.
    fn places(&self, rows: &[usize]) -> Vec<usize> {
        let mut place_of = vec![0; self.rows.len()];
        for (place, &row) in self.rows.iter().enumerate() {
            place_of[row] = place;
        }
        let mut places: Vec<_> = rows.iter().map(|&row| place_of[row]).collect();
        places.sort_unstable();
        places
    }
}

/// What one view of the query found.
#[derive(Debug, Clone, Default)]
struct Local {
    map_from_query: Option<Similarity>,
    /// Pairs kept by the clique, with their distance after the alignment.
    pairs: Vec<(usize, usize, f64)>,
    counts: StageCounts,
}

/// Counts of the stages, summed over views.
#[derive(Debug, Clone, Copy, Default)]
struct StageCounts {
    constellations: usize,
    assigned: usize,
    samples: usize,
    inliers: usize,
    completed: usize,
    inconsistent: usize,
    /// Views whose clique may not be the largest.
    cut_short: usize,
}

impl std::ops::Add for StageCounts {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            constellations: self.constellations + other.constellations,
            assigned: self.assigned + other.assigned,
            samples: self.samples + other.samples,
            inliers: self.inliers + other.inliers,
            completed: self.completed + other.completed,
            inconsistent: self.inconsistent + other.inconsistent,
            cut_short: self.cut_short + other.cut_short,
        }
    }
}

impl PaperMap {
    /// # Errors
    /// Where the map gives more constellations than memory should hold.
    pub(crate) fn new(map: &[Point3<f64>], config: &Config) -> Result<Self> {
        check_size("map", map.len(), config)?;
        let fruits = Ordered::new(map);
        let codes = codebook(&fruits.positions, config.constellation.k, config.constellation.n);
        let tree = Index::new(fruits.positions.iter().map(|p| [p.x, p.y, p.z]).collect());
        let spacing_m = median_spacing(&tree);
        Ok(Self { codes, spacing_m, evidence: PairOdds::new(tree), fruits })
    }

    /// Matches a query cloud; `request.up` is not used by this method.
    ///
    /// # Errors
    /// Where the query gives too many constellations, or frames are asked for and not known.
    pub(crate) fn search(&self, query: &FruitCloud, request: &Request, config: &Config) -> Result<Match> {
        check_size("query", query.len(), config)?;
        let fruits = Ordered::new(&query.positions);
        let views = views_of(query, &fruits, request)?;
        let lengths = self.lengths(request, &config.paper);
        let ballots = self.codes.vote(&fruits.positions, &views, lengths.max_code_distance);
        let locals: Vec<_> = views
            .par_iter()
            .zip(&ballots)
            .map(|(view, ballot)| self.solve(&fruits, view, ballot, request.scale, &lengths))
            .collect();
        let counts = locals.iter().fold(StageCounts::default(), |sum, local| sum + local.counts);
        let mut stages = vec![
            ("views", views.len() as f64),
            ("map constellations", self.codes.len() as f64),
            ("query constellations", counts.constellations as f64),
            ("pairs with votes", ballots.iter().map(|b| b.votes.len()).sum::<usize>() as f64),
            ("assigned pairs", counts.assigned as f64),
            ("RANSAC samples", counts.samples as f64),
            ("agreeing pairs", counts.inliers as f64),
            ("completed pairs", counts.completed as f64),
            ("inconsistent pairs", counts.inconsistent as f64),
            ("cliques cut short", counts.cut_short as f64),
        ];
        let merged = merge(&locals, fruits.positions.len(), self.fruits.positions.len());
        let registration = match &locals[..] {
            [whole] => whole.map_from_query,
            _ => self.register(&fruits, &merged, request.scale, &lengths),
        };
        stages.push(("views aligned", locals.iter().filter(|l| l.map_from_query.is_some()).count() as f64));
        let Some(map_from_query) = registration else {
            return Ok(Match::without_answer(Verdict::NoMatch, stages));
        };
        Ok(self.answer(&fruits, &merged, &ballots, map_from_query, request, stages))
    }

    /// The settings with lengths in the unit of the map, and the gates narrowed to a known noise.
    fn lengths(&self, request: &Request, paper: &PaperConfig) -> PaperConfig {
        let unit = match request.scale {
            Scale::Metric => 1.0,
            Scale::Free => self.spacing_m / CLUSTER_SPACING_M,
        };
        // 99 % of three axes lie within 3.37 sigma; 6 sigma are 4.2 of a difference of two distances.
        let gate = |length: f64, sigmas: f64| request.noise_m.map_or(length * unit, |noise| sigmas * noise);
        PaperConfig {
            inlier_m: gate(paper.inlier_m, 3.37),
            completion_m: gate(paper.completion_m, 3.37),
            clique_base_m: gate(paper.clique_base_m, 6.0),
            ..*paper
        }
    }

    /// One view through assignment, alignment, completion and clique.
    fn solve(&self, query: &Ordered, view: &[usize], ballot: &Ballot, scale: Scale, paper: &PaperConfig) -> Local {
        let map = &self.fruits.positions;
        let gains: Vec<_> =
            ballot.votes.iter().map(|v| (v.query as usize, v.map as usize, f64::from(v.count))).collect();
        let mut partners = assign(query.positions.len(), map.len(), &gains);
        let assigned: Vec<_> = partners.iter().enumerate().filter_map(|(q, m)| Some((q, (*m)?))).collect();
        let mut counts =
            StageCounts { constellations: ballot.constellations, assigned: assigned.len(), ..StageCounts::default() };
        let ends = |pairs: &[(usize, usize)]| -> (Vec<_>, Vec<_>) {
            pairs.iter().map(|&(q, m)| (query.positions[q], map[m])).unzip()
        };
        let (source, target) = ends(&assigned);
        let Some(consensus) = ransac(&source, &target, scale, paper.inlier_m, &paper.ransac) else {
            return Local { counts, ..Local::default() };
        };
        counts.samples = consensus.samples;
        counts.inliers = consensus.inliers.len();
        if counts.inliers < paper.min_inliers {
            return Local { counts, ..Local::default() };
        }
        let map_from_query = consensus.target_from_source;
        let mut pairs: Vec<_> = consensus.inliers.iter().map(|&i| assigned[i]).collect();
        partners.fill(None);
        let mut taken_map = vec![false; map.len()];
        let mut taken_query = vec![true; query.positions.len()];
        for &q in view {
            taken_query[q] = false;
        }
        for &(q, m) in &pairs {
            (taken_query[q], taken_map[m]) = (true, true);
        }
        let completed = complete(&query.positions, map, &map_from_query, &taken_query, &taken_map, paper.completion_m);
        counts.completed = completed.len();
        pairs.extend(completed);
        pairs.sort_unstable();
        let (source, target) = ends(&pairs);
        let aligned: Vec<_> = source.iter().map(|p| map_from_query.apply(p)).collect();
        let tolerance = Tolerance { base_m: paper.clique_base_m, per_metre: paper.clique_per_metre };
        let clique = largest_consistent(&aligned, &target, tolerance, paper.clique_max_work);
        counts.inconsistent = pairs.len() - clique.members.len();
        counts.cut_short = usize::from(!clique.is_maximum);
        let kept = |&i: &usize| (pairs[i].0, pairs[i].1, (aligned[i] - target[i]).norm());
        Local { map_from_query: Some(map_from_query), pairs: clique.members.iter().map(kept).collect(), counts }
    }

    /// One transform for pairs of many frames; each already agrees with its frame's own.
    fn register(
        &self,
        query: &Ordered,
        pairs: &[(usize, usize, f64)],
        scale: Scale,
        paper: &PaperConfig,
    ) -> Option<Similarity> {
        let (source, target): (Vec<_>, Vec<_>) =
            pairs.iter().map(|&(q, m, _)| (query.positions[q], self.fruits.positions[m])).unzip();
        let consensus = ransac(&source, &target, scale, paper.inlier_m, &paper.ransac)?;
        (consensus.inliers.len() >= paper.min_inliers).then_some(consensus.target_from_source)
    }

    /// The pairs with what speaks for each, in rows of the input.
    fn answer(
        &self,
        query: &Ordered,
        merged: &[(usize, usize, f64)],
        ballots: &[Ballot],
        map_from_query: Similarity,
        request: &Request,
        stages: Vec<(&'static str, f64)>,
    ) -> Match {
        let distances: Vec<_> = merged.iter().map(|pair| pair.2).collect();
        let noise_m = request.noise_m.unwrap_or_else(|| PairOdds::noise_per_axis(&distances));
        let mut log_odds = 0.0;
        let mut pairs: Vec<_> = merged
            .iter()
            .map(|&(q, m, distance_m)| {
                let votes: u32 = ballots.iter().map(|ballot| ballot.votes.of(q, m)).sum();
                let odds = self.evidence.odds(&self.fruits.positions[m], distance_m, noise_m);
                log_odds += odds.ln_1p();
                Pair {
                    query: query.rows[q],
                    map: self.fruits.rows[m],
                    probability: odds / (1.0 + odds),
                    distance_m,
                    support: f64::from(votes),
                    part: 0,
                }
            })
            .collect();
        pairs.sort_unstable_by_key(|pair| pair.query);
        let registration = Some(Registration { map_from_query, log_odds });
        Match { registration, pairs, noise_m, ..Match::without_answer(Verdict::Found, stages) }
    }
}

/// The whole cloud as one view, or the fruits that each frame saw.
fn views_of(query: &FruitCloud, fruits: &Ordered, request: &Request) -> Result<Vec<Vec<usize>>> {
    if !request.per_frame {
        return Ok(vec![(0..query.len()).collect()]);
    }
    let Some(views) = &query.views else {
        let reason = "the query does not know which frame saw which fruit".to_owned();
        return Err(Error::Request { name: "per_frame", reason });
    };
    Ok(views.by_frame().iter().map(|(_, rows)| fruits.places(rows)).collect())
}

/// One to one over all views, by the number of views that hold a pair; with the mean distance after their alignments.
fn merge(locals: &[Local], n_query: usize, n_map: usize) -> Vec<(usize, usize, f64)> {
    if let [whole] = locals {
        return whole.pairs.clone();
    }
    let mut seen: BTreeMap<(usize, usize), (f64, f64)> = BTreeMap::new();
    for &(q, m, distance) in locals.iter().flat_map(|local| &local.pairs) {
        let entry = seen.entry((q, m)).or_default();
        *entry = (entry.0 + 1.0, entry.1 + distance);
    }
    let gains: Vec<_> = seen.iter().map(|(&(q, m), &(count, _))| (q, m, count)).collect();
    let partners = assign(n_query, n_map, &gains);
    let mean = |key: &(usize, usize)| seen[key].1 / seen[key].0;
    partners.iter().enumerate().filter_map(|(q, m)| m.map(|m| (q, m, mean(&(q, m))))).collect()
}

fn median_spacing(tree: &Index<3>) -> f64 {
    let mut nearest: Vec<_> =
        tree.points().par_iter().filter_map(|p| tree.nearest_few(p, 2).get(1).map(|n| n.distance)).collect();
    nearest.sort_unstable_by(f64::total_cmp);
    nearest.get(nearest.len() / 2).copied().unwrap_or(CLUSTER_SPACING_M)
}

fn check_size(whose: &'static str, n_fruits: usize, config: &Config) -> Result<()> {
    let (k, n) = (config.constellation.k, config.constellation.n.min(n_fruits.saturating_sub(1)));
    let per_fruit = (0..k - 1).fold(1, |product, i| product * n.saturating_sub(i) / (i + 1));
    let most = n_fruits.saturating_mul(per_fruit);
    if most <= MAX_CONSTELLATIONS {
        return Ok(());
    }
    Err(Error::TooManyConstellations { whose, fruits: n_fruits, found: most, most: MAX_CONSTELLATIONS })
}
