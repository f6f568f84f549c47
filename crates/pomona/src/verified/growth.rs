//! Growth of a verified pose over the whole overlap: rigid patches, then a smooth displacement.
//!
//! One rigid transform for a row does not exist (drift, sag; paper, section III-C), so the query is cut into cells.
//! Each cell has its own pose, fitted to the pairs in and around it and held by the pose of a wider neighbourhood
//! where pairs are few. What the patches leave over is smoothed between neighbouring fruits, in the measure in which
//! neighbours' residuals agree. Growth goes from cell to neighbouring cell and stops where the evidence turns.

use super::cells::{Cell, CellIndex, cells_of, key_of, surroundings, total};
use super::hypothesis::{GATE, Hypothesis, Model, PRIOR_FREEDOMS, gaussian};
use super::landscape::Landscape;
use super::pose::{Moments, Pose};
use nalgebra::Vector3;

/// Edge of a cell in spacings of the query: some ten fruits.
const CELL: f64 = 2.5;

/// A patch may differ from its surroundings as if this many pairs held it to them.
const HOLD: f64 = 2.0;

/// Share of the distance by which a crown may have bent between visits (METHOD: alpha = 1-3 %).
const DRIFT: f64 = 0.02;

/// Growth ends at the latest after this many steps from cell to cell beyond the extent of the cloud.
const EXTRA_ROUNDS: usize = 6;

/// A fruit of the query where the grown pose puts it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Prediction {
    pub(crate) place: Vector3<f64>,
    /// Variance per axis of the distance to the partner, square metres of the map.
    pub(crate) variance: f64,
}

/// The overlap that a hypothesis explains.
#[derive(Debug, Clone)]
pub(crate) struct Overlap {
    /// Least-squares pose over all pairs.
    pub(crate) pose: Pose,
    /// Evidence summed over all cells that growth reached, nats.
    pub(crate) log_odds: f64,
    /// Relative noise per axis, metres of the map.
    pub(crate) sigma: f64,
    /// Centroid of the matched fruits, in the centred query.
    pub(crate) middle: Vector3<f64>,
    /// Where each fruit of the query is expected; `None` outside the overlap.
    pub(crate) predictions: Vec<Option<Prediction>>,
}

struct Growth<'a> {
    query: &'a Landscape,
    map: &'a Landscape,
    model: Model,
    cells: Vec<Cell>,
    index: CellIndex,
    edge: f64,
    pose: Pose,
    sigma: f64,
    /// Variance of the displacement that neighbours share, square metres.
    shared: f64,
    predictions: Vec<Option<Prediction>>,
    /// Partner, residual about the patch, weight.
    partners: Vec<Option<(u32, Vector3<f64>, f64)>>,
    owner: Vec<Option<u32>>,
    patch_places: Vec<Vector3<f64>>,
    /// The pose is known to hold everywhere and the noise is given.
    whole: bool,
    /// Factor on the standard deviation of the predictions, to leave a seed's local optimum.
    widening: f64,
    /// Patches follow the common pose.
    rigid: bool,
    /// Degrees of freedom of the expected noise.
    freedoms: f64,
}

/// The first rounds look further than the noise.
const WIDENING: [f64; 4] = [2.0, 2.0, 1.6, 1.3];

/// The first rounds fit one rigid pose: patches would bend towards a seed that is turned by a few degrees.
const RIGID_ROUNDS: usize = 6;

/// Grows a hypothesis as far as the evidence goes.
pub(crate) fn grow(query: &Landscape, map: &Landscape, seed: &Hypothesis, model: &Model) -> Overlap {
    let growth = grown(query, map, seed, model);
    let log_odds = growth.log_odds();
    growth.finish(log_odds)
}

/// The same, and a look at the crowns that growth did not reach.
pub(crate) fn grow_everywhere(query: &Landscape, map: &Landscape, seed: &Hypothesis, model: &Model) -> Overlap {
    let mut growth = grown(query, map, seed, model);
    let log_odds = growth.log_odds();
    growth.reach_all();
    growth.finish(log_odds)
}

fn grown<'a>(query: &'a Landscape, map: &'a Landscape, seed: &Hypothesis, model: &Model) -> Growth<'a> {
    let mut growth = Growth::new(query, map, seed, model);
    let extent = growth.cells.iter().fold(0.0f64, |far, cell| far.max((cell.centre - seed.place).norm()));
    let most = (extent / growth.edge) as usize * 2 + EXTRA_ROUNDS;
    let mut settled = 0;
    for round in 0..most {
        growth.widening = WIDENING.get(round).copied().unwrap_or(1.0);
        growth.rigid = round < RIGID_ROUNDS;
        growth.predict();
        growth.pair_up();
        growth.refit();
        settled = if growth.spread() { 0 } else { settled + 1 };
        if settled == 4 && round > RIGID_ROUNDS + 2 {
            break;
        }
    }
    growth.predict();
    growth.pair_up();
    growth
}

/// Pairs under a pose that holds for the whole query, with the noise as it is given.
pub(crate) fn settle(query: &Landscape, map: &Landscape, whole: &Hypothesis, model: &Model) -> Overlap {
    let mut growth = Growth::new(query, map, whole, model);
    growth.whole = true;
    for cell in &mut growth.cells {
        cell.reached = true;
    }
    for _ in 0..WHOLE_ROUNDS {
        growth.predict();
        growth.pair_up();
        growth.refit();
    }
    growth.predict();
    growth.pair_up();
    let log_odds = growth.log_odds();
    growth.finish(log_odds)
}

/// Rounds of pairing and fitting when the pose is known for the whole query.
const WHOLE_ROUNDS: usize = 4;

impl<'a> Growth<'a> {
    fn new(query: &'a Landscape, map: &'a Landscape, seed: &Hypothesis, model: &Model) -> Self {
        let edge = CELL * query.spacing;
        let (mut cells, index) = cells_of(query, edge, &seed.pose);
        for cell in &mut cells {
            cell.reached = (cell.centre - seed.place).norm() < super::search::REACH * query.spacing;
        }
        if let Some(nearest) =
            cells.iter_mut().min_by(|a, b| (a.centre - seed.place).norm().total_cmp(&(b.centre - seed.place).norm()))
        {
            nearest.reached = true;
        }
        Self {
            query,
            map,
            model: *model,
            cells,
            index,
            edge,
            pose: seed.pose,
            sigma: seed.sigma,
            shared: 0.0,
            predictions: vec![None; query.len()],
            partners: vec![None; query.len()],
            owner: vec![None; map.len()],
            patch_places: vec![Vector3::zeros(); query.len()],
            whole: false,
            widening: 1.0,
            rigid: false,
            freedoms: PRIOR_FREEDOMS,
        }
    }

    /// Where each fruit of the reached cells should lie, and how surely.
    fn predict(&mut self) {
        self.predictions.fill(None);
        let sigma2 = (self.widening * self.sigma).powi(2);
        for cell in self.cells.iter().filter(|cell| cell.reached) {
            let wide = surroundings(&self.cells, cell);
            let known = wide.weight > 3.5;
            let (centroid, inertia) = if known {
                (wide.centroid(), wide.weight * wide.spread().trace() * 2.0 / 3.0)
            } else {
                (cell.centre, 0.1 * self.edge * self.edge)
            };
            for &row in &cell.rows {
                let p = self.query.points[row as usize];
                let away2 = (p - centroid).norm_squared();
                let variance = sigma2
                    * (1.0 + 1.0 / (wide.weight + HOLD) + away2 / (inertia + HOLD * self.edge * self.edge))
                    + DRIFT * DRIFT * away2 * f64::from(u8::from(away2 > self.edge * self.edge));
                let place = cell.pose.apply(&p);
                self.patch_places[row as usize] = place;
                let (shift, unexplained) = self.displacement(row);
                self.predictions[row as usize] =
                    Some(Prediction { place: place + shift, variance: variance + unexplained });
            }
        }
    }

    /// Mean residual of the matched neighbours, the fruit itself left out, shrunk by the noise; and the variance left.
    fn displacement(&self, row: u32) -> (Vector3<f64>, f64) {
        if self.shared <= 0.0 {
            return (Vector3::zeros(), 0.0);
        }
        let p = self.query.points[row as usize];
        let width = SMOOTHING * self.query.spacing;
        let mut sum = Vector3::zeros();
        let mut total = 0.0;
        for &other in &self.query.neighbours[row as usize] {
            if let Some((_, residual, weight)) = self.partners[other as usize] {
                let d2 = (self.query.points[other as usize] - p).norm_squared();
                let kernel = weight * (-0.5 * d2 / (width * width)).exp();
                sum += residual * kernel;
                total += kernel;
            }
        }
        let noise = self.sigma * self.sigma / self.shared;
        (sum / (total + noise), self.shared * noise / (total + noise))
    }

    /// Nearest partners of the predictions; of several claims on one fruit the likelier wins.
    fn pair_up(&mut self) {
        self.owner.fill(None);
        self.partners.fill(None);
        let mut gains = vec![0.0; self.query.len()];
        for cell in self.cells.iter_mut().filter(|cell| cell.reached) {
            cell.moments = Moments::default();
            cell.log_odds = 0.0;
            for &row in &cell.rows {
                let Some(Prediction { place, variance }) = self.predictions[row as usize] else { continue };
                let Some((partner, d2)) = self.map.nearest(&place, GATE * variance.sqrt(), |_| true) else {
                    gains[row as usize] = self.model.miss(self.map.support(&place));
                    continue;
                };
                let gain = self.model.gain(d2, variance, self.map.density[partner as usize]);
                let rival = self.owner[partner as usize];
                if rival.is_some_and(|rival| gains[rival as usize] >= gain) {
                    gains[row as usize] = self.model.miss(self.map.support(&place));
                    continue;
                }
                if let Some(rival) = rival {
                    self.partners[rival as usize] = None;
                    gains[rival as usize] = self.model.miss(self.map.support(&place));
                }
                self.owner[partner as usize] = Some(row);
                gains[row as usize] = gain;
                let weight = (1.0 - (1.0 - self.model.detection) * (-gain).exp()).max(0.0);
                let residual = self.map.points[partner as usize] - self.patch_places[row as usize];
                self.partners[row as usize] = Some((partner, residual, weight));
            }
        }
        for cell in self.cells.iter_mut().filter(|cell| cell.reached) {
            for &row in &cell.rows {
                cell.log_odds += gains[row as usize];
                if let Some((partner, _, weight)) = self.partners[row as usize] {
                    cell.moments.add(&self.query.points[row as usize], &self.map.points[partner as usize], weight);
                }
            }
        }
    }

    /// New patch poses, global pose, noise and shared displacement from the current pairs.
    fn refit(&mut self) {
        let all = total(self.cells.iter().filter(|c| c.reached).map(|c| (&c.moments, 1.0)));
        if all.weight < 3.5 {
            return;
        }
        if let Some(pose) = all.step(&self.pose, self.model.scale, 0.0) {
            self.pose = pose;
        }
        for i in (0..self.cells.len()).filter(|&i| self.cells[i].reached).collect::<Vec<_>>() {
            if self.rigid {
                self.cells[i].pose = self.pose;
                continue;
            }
            let wide = surroundings(&self.cells, &self.cells[i]);
            let mut parent = self.cells[i].pose;
            if wide.weight > 6.0 {
                parent = wide.step(&parent, self.model.scale, HOLD * self.edge * self.edge).unwrap_or(parent);
            }
            let mut near = total(
                self.cells[i].around.iter().filter(|a| a.1 > 0.3).map(|a| (&self.cells[a.0 as usize].moments, a.1)),
            );
            let centre = self.cells[i].centre;
            near.add(&centre, &parent.apply(&centre), HOLD);
            self.cells[i].pose =
                near.step(&parent, crate::geometry::Scale::Metric, HOLD * self.edge * self.edge).unwrap_or(parent);
        }
        if !self.whole {
            self.estimate_noise();
        }
    }

    /// Noise from the residuals, shared displacement from the products of neighbours' residuals (noise is independent).
    fn estimate_noise(&mut self) {
        let (mut squares, mut weights, mut products, mut pairs) = (0.0, 0.0, 0.0, 0.0);
        let width2 = (SMOOTHING * self.query.spacing).powi(2);
        for (row, partner) in self.partners.iter().enumerate() {
            let Some((_, residual, weight)) = partner else { continue };
            squares += weight * residual.norm_squared();
            weights += weight;
            for &other in &self.query.neighbours[row] {
                let Some((_, rival, other_weight)) = self.partners[other as usize] else { continue };
                let d2 = (self.query.points[other as usize] - self.query.points[row]).norm_squared();
                let kernel = weight * other_weight * (-0.5 * d2 / width2).exp();
                products += kernel * residual.dot(&rival);
                pairs += kernel;
            }
        }
        if weights < 3.5 {
            return;
        }
        self.shared = if weights > 20.0 && pairs > 0.0 { (products / pairs / 3.0).max(0.0) } else { 0.0 };
        if self.shared < 0.01 * self.sigma * self.sigma {
            self.shared = 0.0;
        }
        // Residuals about the patches hold noise and shared displacement; the gate cuts 3 % off.
        let mean = squares / (3.0 * weights - 6.0).max(weights);
        let prior = self.model.sigma * self.model.sigma;
        let noise = (self.freedoms * prior + 3.0 * weights * (mean - self.shared).max(0.04 * mean))
            / (self.freedoms + 3.0 * weights);
        self.sigma = noise.sqrt();
    }

    /// Reaches the neighbours of cells whose surroundings speak for the pose; returns whether any is new.
    fn spread(&mut self) -> bool {
        let sources: Vec<bool> = (0..self.cells.len()).map(|i| self.convincing(i)).collect();
        let mut new = Vec::new();
        for (i, _) in sources.iter().enumerate().filter(|s| *s.1) {
            for &(other, closeness) in &self.cells[i].around {
                if closeness > 0.3 && !self.cells[other as usize].reached {
                    new.push((other as usize, self.cells[i].pose));
                }
            }
        }
        for &(i, pose) in &new {
            if !self.cells[i].reached {
                self.cells[i].reached = true;
                self.cells[i].pose = pose;
            }
        }
        !new.is_empty()
    }

    /// Whether a reached cell and its neighbours together have evidence for the pose.
    fn convincing(&self, i: usize) -> bool {
        let cell = &self.cells[i];
        self.whole
            || cell.reached
                && cell.around.iter().map(|a| a.1 * self.cells[a.0 as usize].log_odds).sum::<f64>() > CONVINCING
    }

    /// Evidence of the cells that growth reached, both sides counted (see `hypothesis::other_side`), under the share of
    /// fruits seen again that suits it best.
    fn log_odds(&self) -> f64 {
        let here: Vec<(f64, f64)> = self
            .predictions
            .iter()
            .zip(&self.partners)
            .filter_map(|(prediction, partner)| prediction.map(|at| (at, partner)))
            .map(|(at, partner)| {
                let ratio = partner.map_or(f64::NAN, |(row, ..)| {
                    let d2 = (self.map.points[row as usize] - at.place).norm_squared();
                    gaussian(d2, at.variance) / self.map.density[row as usize]
                });
                (ratio, self.map.support(&at.place))
            })
            .collect();
        let there = self.unmatched_map_supports();
        SHARES_SEEN_AGAIN
            .iter()
            .map(|share| {
                let of_query: f64 = here
                    .iter()
                    .map(|&(ratio, support)| {
                        let odds = if ratio.is_nan() { 1.0 - share * support } else { 1.0 - share + share * ratio };
                        odds.ln() + share * support
                    })
                    .sum();
                of_query + there.iter().map(|support| (1.0 - share * support).ln()).sum::<f64>()
            })
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// For the fruits of the map without a partner that lie in the reached cells: how surely the query looked there.
    fn unmatched_map_supports(&self) -> Vec<f64> {
        self.map
            .points
            .iter()
            .zip(&self.owner)
            .filter(|(_, owner)| owner.is_none())
            .map(|(p, _)| self.pose.apply_inverse(p))
            .filter(|place| self.index.get(&key_of(place, self.edge)).is_some_and(|&cell| self.cells[cell].reached))
            .map(|place| self.query.support(&place))
            .collect()
    }

    /// Looks once at the cells that growth did not reach: a crown may be cut off by a gap without fruits.
    ///
    /// They add pairs where they convince, but nothing to the evidence, which would be the better of two tries.
    fn reach_all(&mut self) {
        self.freedoms = PAIR_FREEDOMS;
        for cell in self.cells.iter_mut().filter(|cell| !cell.reached) {
            cell.reached = true;
            cell.pose = self.pose;
        }
        self.predict();
        self.pair_up();
        let outside: Vec<usize> = (0..self.cells.len()).filter(|&i| !self.convincing(i)).collect();
        for i in outside {
            self.cells[i].reached = false;
            self.cells[i].moments = Moments::default();
        }
        for _ in 0..2 {
            self.refit();
            self.predict();
            self.pair_up();
        }
    }

    fn finish(mut self, log_odds: f64) -> Overlap {
        let outside: Vec<usize> = (0..self.cells.len()).filter(|&i| !self.convincing(i)).collect();
        for i in outside {
            for &row in &self.cells[i].rows {
                self.predictions[row as usize] = None;
            }
        }
        let all = total(self.cells.iter().filter(|c| c.reached).map(|c| (&c.moments, 1.0)));
        let middle = if all.weight > 0.0 { all.centroid() } else { Vector3::zeros() };
        Overlap { middle, pose: self.pose, log_odds, sigma: self.sigma, predictions: self.predictions }
    }
}

/// Shares of fruits seen again that are tried: heavy occlusion to a bare tree.
const SHARES_SEEN_AGAIN: [f64; 4] = [0.35, 0.55, 0.75, 0.9];

/// Degrees of freedom of the expected noise when pairs are made: few pairs fit themselves more closely than the fruits
/// that are still to be paired.
const PAIR_FREEDOMS: f64 = 12.0;

/// Width of the kernel that smooths displacements, in spacings: a branch's reach.
const SMOOTHING: f64 = 1.0;

/// Evidence in nats of a cell and its neighbours that lets growth go on from there.
const CONVINCING: f64 = 2.0;
