//! The patches of a growth: where each puts its fruits, whom they meet there, and what follows for the patches.
//!
//! A patch is fitted to the pairs in and around its cell and held by the pose of a wider neighbourhood where pairs are
//! few. What the patches leave over is smoothed between neighbouring fruits, in the measure in which neighbours'
//! residuals agree.

use super::cut::{Cell, surroundings, total};
use super::displacement::{carried_on, shared_by_neighbours};
use super::growth::{Growth, Partner};
use super::hypothesis::{GATE, PRIOR_FREEDOMS};
use super::nearest::SHARE_OF_ROWS;
use super::placement::{FIXING, Landing, Moments, Placement};
use super::seeds::STARS;
use super::sight::is_among;
use crate::geometry::Scale;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::mem::take;

/// A patch may differ from its surroundings as if this many pairs held it to them.
pub(super) const HOLD: f64 = 2.0;

/// Cells of a patch's own fit, by their weight (see [`super::cut`]): those next to it.
const NEXT: f64 = 0.3;

/// Cells at the least that are worth a thread of their own.
pub(super) const SHARE_OF_CELLS: usize = 32;

/// How firmly pairs hold a pose: at `p` its variance is that of one pair times [`Footing::looseness`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Footing {
    middle: Vector3<f64>,
    weight: f64,
    inertia: f64,
}

impl Footing {
    /// As well as a seed gives a pose at `place` for a region of this `reach`: 6 cm at 1 m for 2 cm of noise.
    pub(super) fn of_seed(place: &Vector3<f64>, reach: f64) -> Self {
        Self { middle: *place, weight: STARS as f64, inertia: 0.1 * reach * reach }
    }

    /// Of a fit to `moments`, held by as many pairs as `hold` about `centre`, an `edge` away.
    pub(super) fn new(moments: &Moments, hold: f64, edge: f64, centre: Vector3<f64>) -> Self {
        let (middle, inertia) =
            if moments.weight > FIXING { (moments.centroid(), moments.inertia()) } else { (centre, 0.1 * edge * edge) };
        Self { middle, weight: moments.weight + hold, inertia: inertia + hold * edge * edge }
    }

    #[inline]
    pub(super) fn looseness(&self, p: &Vector3<f64>) -> f64 {
        1.0 / self.weight + (p - self.middle).norm_squared() / self.inertia
    }

    /// How much a pose that is held by `hold` pairs follows what holds it.
    #[inline]
    pub(super) fn share_held(&self, hold: f64) -> f64 {
        hold / self.weight
    }
}

/// Sums over the cells next to a cell, itself included.
pub(super) fn next_to(cells: &[Cell], cell: &Cell) -> Moments {
    total(cell.around.iter().filter(|a| a.1 > NEXT).map(|a| (&cells[a.0 as usize].moments, a.1)))
}

/// The nearest fruit of the map with the probability that it is no stranger, and the log-odds of it, or of having none.
struct Met {
    partner: Option<(u32, f64)>,
    gain: f64,
}

impl Growth<'_> {
    /// Where each fruit of the reached cells should lie, and how surely.
    pub(super) fn predict(&mut self) {
        let sigma2 = (self.widening * self.sigma).powi(2);
        let footing = |(cell, wide): (&Cell, &Option<Moments>)| {
            cell.reached.then(|| {
                let wide = wide.unwrap_or_else(|| surroundings(&self.cells, cell));
                Footing::new(&wide, HOLD, self.edge, cell.centre)
            })
        };
        let footings: Vec<Option<Footing>> = self.cells.iter().zip(&self.wide).map(footing).collect();
        let residual = |row: usize| self.partners[row].map(|partner| (partner.residual, partner.weight));
        let unseen = &self.unseen[0];
        let at = |row: usize| {
            if is_among(unseen, row) {
                return None;
            }
            let cell = self.cut.cell_of[row] as usize;
            let footing = footings[cell]?;
            let p = self.query.points[row];
            let place = self.cells[cell].pose.apply(&p);
            let (shift, unexplained) = carried_on(self.query, row, (self.shared, self.sigma * self.sigma), residual);
            let variance = sigma2 * (1.0 + footing.looseness(&p)) + unexplained;
            Some((place, Landing { place: place + shift, variance }))
        };
        let (mut predictions, mut places) = (take(&mut self.predictions), take(&mut self.patch_places));
        let both = predictions.par_iter_mut().zip(&mut places).enumerate().with_min_len(SHARE_OF_ROWS);
        both.for_each(|(row, (prediction, patch_place))| {
            if let Some((place, found)) = at(row) {
                (*patch_place, *prediction) = (place, Some(found));
            }
        });
        (self.predictions, self.patch_places) = (predictions, places);
    }

    /// Nearest partners of the predictions; of several claims on one fruit the likelier wins.
    pub(super) fn pair_up(&mut self) {
        let active = self.active();
        let meet = |&row: &u32| self.predictions[row as usize].map(|at| self.meet(&at));
        let met: Vec<Option<Met>> = active.par_iter().with_min_len(SHARE_OF_ROWS).map(meet).collect();
        for &row in &active {
            if let Some(partner) = self.partners[row as usize].take() {
                self.owner[partner.row as usize] = None;
            }
        }
        let mut gains = vec![0.0; self.query.len()];
        for (row, met) in active.into_iter().map(|row| row as usize).zip(met) {
            let Some(Met { partner, gain }) = met else { continue };
            gains[row] = gain;
            let Some((partner, weight)) = partner else { continue };
            if let Some(rival) = self.owner[partner as usize].map(|rival| rival as usize) {
                if gains[rival] >= gain {
                    gains[row] = self.alone(row);
                    continue;
                }
                self.partners[rival] = None;
                gains[rival] = self.alone(rival);
            }
            self.owner[partner as usize] = Some(row as u32);
            let residual = self.map.points[partner as usize] - self.patch_places[row];
            self.partners[row] = Some(Partner { row: partner, residual, weight });
        }
        self.sum_up(&gains);
    }

    /// What a prediction meets in the map.
    fn meet(&self, Landing { place, variance }: &Landing) -> Met {
        let Some((row, d2)) = self.map.nearest(place, GATE * variance.sqrt()) else {
            return Met { partner: None, gain: self.model.missed(self.map.support(place)).ln() };
        };
        let ratio = self.model.met(d2, *variance, self.map.density[row as usize]);
        let weight = self.model.no_stranger(ratio).max(0.0);
        Met { partner: Some((row, weight)), gain: ratio.ln() }
    }

    /// Log-odds of a fruit that has lost its partner to another.
    fn alone(&self, row: usize) -> f64 {
        self.predictions[row].map_or(0.0, |at| self.model.missed(self.map.support(&at.place)).ln())
    }

    /// Evidence and sums of every reached cell.
    fn sum_up(&mut self, gains: &[f64]) {
        let (query, map, partners) = (self.query, self.map, &self.partners);
        self.cells.par_iter_mut().with_min_len(SHARE_OF_CELLS).filter(|cell| cell.reached).for_each(|cell| {
            cell.moments = Moments::default();
            cell.log_odds = 0.0;
            for &row in cell.rows.iter() {
                cell.log_odds += gains[row as usize];
                if let Some(Partner { row: partner, weight, .. }) = partners[row as usize] {
                    cell.moments.add(&query.points[row as usize], &map.points[partner as usize], weight);
                }
            }
        });
        let around = |cell: &Cell| cell.reached.then(|| surroundings(&self.cells, cell));
        self.wide = self.cells.par_iter().with_min_len(SHARE_OF_CELLS).map(around).collect();
    }

    /// New patch poses, global pose, noise and shared displacement from the current pairs.
    pub(super) fn refit(&mut self) {
        let all = total(self.cells.iter().filter(|c| c.reached).map(|c| (&c.moments, 1.0)));
        if all.weight < FIXING {
            return;
        }
        if let Some(pose) = self.model.step(&all, &self.pose, self.sigma) {
            self.pose = pose;
        }
        let refitted = |(cell, wide): (&Cell, &Option<Moments>)| match wide {
            Some(_) if self.rigid => self.pose,
            Some(wide) => self.patch(cell, wide),
            None => cell.pose,
        };
        let both = self.cells.par_iter().zip(&self.wide).with_min_len(SHARE_OF_CELLS);
        let poses: Vec<Placement> = both.map(refitted).collect();
        self.cells.iter_mut().zip(poses).for_each(|(cell, pose)| cell.pose = pose);
        if !self.whole {
            self.estimate_noise();
        }
    }

    /// The pose of one patch from the pairs next to it, held by that of its surroundings.
    fn patch(&self, cell: &Cell, wide: &Moments) -> Placement {
        let prior = HOLD * self.edge * self.edge;
        let parent = wide.step(&cell.pose, self.model.scale, prior).unwrap_or(cell.pose);
        let mut near = next_to(&self.cells, cell);
        near.add(&cell.centre, &parent.apply(&cell.centre), HOLD);
        near.step(&parent, Scale::Metric, prior).unwrap_or(parent)
    }

    /// Noise from the residuals, shared displacement from the products of neighbours' residuals.
    fn estimate_noise(&mut self) {
        let (mut squares, mut weights) = (0.0, 0.0);
        for partner in self.partners.iter().flatten() {
            squares += partner.weight * partner.residual.norm_squared();
            weights += partner.weight;
        }
        if weights < FIXING {
            return;
        }
        let residual = |row: usize| self.partners[row].map(|partner| (partner.residual, partner.weight));
        self.shared = shared_by_neighbours(self.query, self.sigma, residual);
        // Residuals about the patches hold noise and shared displacement; the gate cuts 3 % off.
        let mean = squares / (3.0 * weights - 6.0).max(weights);
        let prior = self.model.sigma * self.model.sigma;
        let noise =
            (PRIOR_FREEDOMS * prior + 3.0 * weights * (mean - self.shared).max(0.0)) / (PRIOR_FREEDOMS + 3.0 * weights);
        self.sigma = noise.sqrt();
    }
}
