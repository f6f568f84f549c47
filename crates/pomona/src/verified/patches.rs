//! The query laid on the map in patches: what growth and settlement have in common.
//!
//! Both are one loop. Every fruit is predicted, partners are found near the predictions, and the patches are fitted to them.
//! They differ in the partner of a fruit: the nearest, while growth goes on, and in the end the mean of all that it may be
//! ([`super::settlement`]). A patch is fitted to the pairs in and around its cell and held by the pose of a wider
//! neighbourhood, in the measure in which neighbours move together. What patches leave over is carried on from fruit to
//! fruit ([`super::displacement`]).

use super::cut::{Cell, Cut};
use super::direction::Direction;
use super::displacement::{Residual, carried_on, products, shared_by_neighbours};
use super::footing::Footing;
use super::hypothesis::Model;
use super::landscape::Landscape;
use super::sight::Sight;
use crate::geometry::{Scale, Similarity};
use crate::moments::{FIXING, Moments};
use crate::neighbours::cells::cell_of;
use crate::neighbours::others::each_row;
use crate::neighbours::tree::single;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Weights (see [`super::cut`]) that cells around a cell exceed: those that its patch is fitted to, next to it, and
/// those of its surroundings, all of them.
pub(super) const NEXT: f64 = 0.3;
pub(super) const ALL: f64 = 0.0;

/// Cells at the least that are worth a thread of their own.
const SHARE_OF_CELLS: usize = 8;

/// A fruit of the query where the grown pose puts it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Landing {
    pub(crate) place: Vector3<f64>,
    /// Variance per axis of the distance to the partner, square metres of the map.
    pub(crate) variance: f64,
}

/// Partner of a fruit, or the mean of all that it may be, and the probability that it has one.
pub(super) type Target = Option<(Vector3<f64>, f64)>;

/// A query laid on a map, each cell with a pose of its own.
#[derive(Debug, Clone)]
pub(crate) struct Patchwork<'a> {
    pub(super) query: &'a Landscape,
    pub(super) map: &'a Landscape,
    pub(super) cut: &'a Cut,
    pub(super) model: Model,
    pub(super) cells: Vec<Cell>,
    /// The common pose.
    pub(super) pose: Similarity,
    /// Noise of a pair under a pose that is known exactly, metres of the map.
    pub(super) sigma: f64,
    pub(super) direction: Direction,
    /// Fruits of the map around those of the query that are others, over those that each visit shows around its own.
    pub(super) strangers: f64,
    /// Probability that another tree stands at each fruit of the query by now.
    pub(super) replaced: Vec<f64>,
    /// Variance that neighbours' residuals about the patches share, square metres.
    pub(super) shared: f64,
    pub(super) targets: Vec<Target>,
    /// What patches left over when it was looked at last: from where they put a fruit to its partner.
    pub(super) left_over: Vec<Residual>,
    pub(super) predictions: Vec<Option<Landing>>,
    /// What each visit can have seen of the other's fruits; `None` where both looked alike.
    pub(super) sight: Option<Sight>,
}

impl<'a> Patchwork<'a> {
    /// All cells under one pose, none of them reached.
    pub(super) fn new(query: &'a Landscape, map: &'a Landscape, pose: Similarity, sigma: f64, model: &Model) -> Self {
        let cut = query.cut();
        let cells = cut.cells.iter().map(|cell| Cell { pose, ..cell.clone() }).collect();
        Self {
            query,
            map,
            cut,
            model: *model,
            cells,
            pose,
            sigma,
            direction: Direction::default(),
            strangers: 1.0,
            replaced: vec![0.0; query.len()],
            shared: 0.0,
            targets: vec![None; query.len()],
            left_over: vec![None; query.len()],
            predictions: vec![None; query.len()],
            sight: None,
        }
    }

    /// Where the patch puts a fruit.
    fn placed(&self, row: usize) -> Vector3<f64> {
        self.cells[self.cut.cell_of[row] as usize].pose.image(&self.query.points[row])
    }

    /// From where the patches put the fruits now to their partners.
    fn residuals(&self) -> Vec<Residual> {
        let targets = self.targets.iter().enumerate();
        targets.map(|(row, target)| target.map(|(target, weight)| (target - self.placed(row), weight))).collect()
    }

    /// Predicts the fruits of the reached cells: `footing` says how firmly pairs hold the poses of a cell,
    /// `landing` what that makes of a fruit.
    pub(super) fn predict<F: Copy + Send + Sync>(
        &mut self,
        footing: impl Fn(&Self, &Cell) -> F + Sync,
        landing: impl Fn(&Self, usize, F) -> Landing + Sync,
    ) {
        let footing = |cell: &Cell| cell.is_open().then(|| footing(self, cell));
        let footings: Vec<Option<F>> = self.cells.par_iter().with_min_len(SHARE_OF_CELLS).map(footing).collect();
        let at = |row: usize| {
            let cell = self.cut.cell_of[row] as usize;
            if let Some(footing) = footings[cell] {
                return Some(landing(self, row, footing));
            }
            self.predictions[row].filter(|_| self.cells[cell].reached)
        };
        self.predictions = each_row(self.query.len(), at);
    }

    /// How firmly the pairs of cells around whose weight exceeds `least`, and as many more as `hold`, hold the pose
    /// of a cell.
    pub(super) fn footing(&self, cell: &Cell, least: f64, hold: f64) -> Footing {
        Footing::new(&self.pairs_around(cell, least), hold, self.cut.edge, cell.centre)
    }

    /// Where a fruit should lie, whose patch has the variance of one pair times `looseness`; noise is taken to be `widening` times
    /// as large.
    pub(super) fn landing(&self, row: usize, looseness: f64, widening: f64) -> Landing {
        let noise = self.sigma * self.sigma;
        let (shift, unexplained) = carried_on(self.query, row, (self.shared, noise), &self.left_over);
        Landing {
            place: self.placed(row) + shift,
            variance: widening * widening * noise * (1.0 + looseness) + unexplained,
        }
    }

    /// Sums of the pairs in every reached cell.
    pub(super) fn sum_up(&mut self) {
        let (query, targets) = (self.query, &self.targets);
        let of_cell = |cell: &mut Cell| {
            cell.moments = Moments::default();
            for &row in cell.rows.iter() {
                if let Some((target, weight)) = targets[row as usize] {
                    cell.moments.add(&query.points[row as usize], &target, weight);
                }
            }
        };
        self.cells.par_iter_mut().with_min_len(SHARE_OF_CELLS).filter(|cell| cell.is_open()).for_each(of_cell);
    }

    /// Sums over all pairs.
    pub(super) fn all_pairs(&self) -> Moments {
        Moments::total(self.cells.iter().filter(|cell| cell.reached).map(|cell| (&cell.moments, 1.0)))
    }

    /// Sums over the pairs in a cell and in those around whose weight exceeds `least`.
    fn pairs_around(&self, cell: &Cell, least: f64) -> Moments {
        let near = cell.around.iter().filter(|(_, weight)| *weight > least);
        Moments::total(near.map(|&(other, weight)| (&self.cells[other as usize].moments, weight)))
    }

    /// The common pose from the pairs, for all cells; `false` where they are too few.
    pub(super) fn fit_as_one(&mut self) -> bool {
        let all = self.all_pairs();
        if all.weight < FIXING {
            return false;
        }
        self.pose = self.model.step(&all, &self.pose, self.sigma).unwrap_or(self.pose);
        true
    }

    /// The common pose for every cell.
    pub(super) fn stiffen(&mut self) {
        self.cells.iter_mut().for_each(|cell| cell.pose = self.pose);
    }

    /// Surroundings and patches from the pairs, each held to the pose that it has by as many pairs as `hold` says. Returns
    /// the holds of patches and surroundings.
    pub(super) fn bend(&mut self, hold: impl Fn(&Self) -> f64) -> [f64; 2] {
        let of_surroundings = hold(self);
        self.fit(ALL, of_surroundings);
        let of_patches = hold(self);
        self.fit(NEXT, of_patches);
        [of_patches, of_surroundings]
    }

    /// Looks at what patches leave over.
    pub(super) fn look(&mut self) {
        self.left_over = self.residuals();
    }

    /// What neighbours share of what patches left over; returns the squares of the rest and the weight of the pairs.
    pub(super) fn share(&mut self) -> (f64, f64) {
        let (query, left_over) = (self.query, &self.left_over);
        let of_cell = |cell: &mut Cell| cell.shared = products(query, &cell.rows, left_over);
        self.cells.par_iter_mut().with_min_len(SHARE_OF_CELLS).filter(|cell| cell.is_open()).for_each(of_cell);
        self.shared = shared_by_neighbours(self.cells.iter().filter(|cell| cell.reached).map(|cell| cell.shared));
        let (squares, weight) = self
            .left_over
            .iter()
            .flatten()
            .fold((0.0, 0.0), |sum, (residual, weight)| (sum.0 + weight * residual.norm_squared(), sum.1 + weight));
        ((squares - 3.0 * weight * self.shared).max(0.0), weight)
    }

    /// Pairs that hold a pose to the one above it: noise over the variance by which neighbours differ from that
    /// together.
    pub(super) fn firmness(&self) -> f64 {
        let residuals = self.residuals();
        let of_cell = |cell: &Cell| products(self.query, &cell.rows, &residuals);
        let parts: Vec<[f64; 2]> = self.cells.par_iter().with_min_len(SHARE_OF_CELLS).map(of_cell).collect();
        let shared = shared_by_neighbours(parts.into_iter());
        1.0 / (shared / (self.sigma * self.sigma)).max(f64::EPSILON)
    }

    /// Fits every cell's pose to the pairs of cells around whose weight exceeds `least`, held to the pose that it has.
    fn fit(&mut self, least: f64, hold: f64) {
        let prior = hold * self.cut.edge * self.cut.edge;
        let fitted = |cell: &Cell| {
            if !cell.is_open() {
                return cell.pose;
            }
            let mut moments = self.pairs_around(cell, least);
            moments.add(&cell.centre, &cell.pose.image(&cell.centre), hold);
            moments.step(&cell.pose, Scale::Metric, prior).unwrap_or(cell.pose)
        };
        let poses: Vec<Similarity> = self.cells.par_iter().with_min_len(SHARE_OF_CELLS).map(fitted).collect();
        self.cells.iter_mut().zip(poses).for_each(|(cell, pose)| cell.pose = pose);
    }

    /// Share of the fruits in the depth of one of the query that the map's visit can have seen.
    pub(super) fn share_seen(&self, row: usize) -> f64 {
        self.sight.as_ref().map_or(1.0, |sight| sight.shares[0][row])
    }

    /// How surely the map's visit would have shown a fruit of the query that lies at `place`.
    pub(super) fn shown(&self, row: usize, place: &Vector3<f64>) -> f64 {
        self.share_seen(row) * self.map.support.at(place)
    }

    /// How surely the map's visit would have shown each fruit of the query, where it is predicted.
    pub(super) fn due(&self) -> Vec<f64> {
        let shown = |(row, at): (usize, &Option<Landing>)| at.map_or(0.0, |at| self.shown(row, &at.place));
        self.predictions.iter().enumerate().map(shown).collect()
    }

    /// Fruits of the map that may lie in cells of the query under the common pose: no others were looked at.
    pub(super) fn within_reach(&self) -> impl Iterator<Item = u32> + use<> {
        let mut rows = Vec::new();
        let reach = self.pose.scale * self.cut.reach;
        self.map.tree.within(&single(&self.pose.translation), reach as f32, |row, _| rows.push(row));
        rows.into_iter()
    }

    /// How surely the query would have shown a fruit of the map; 0 outside the reached cells.
    pub(super) fn looked_at(&self, row: usize) -> f64 {
        let place = self.pose.preimage(&self.map.points[row]);
        let cell = self.cut.index.get(&cell_of(&place, 1.0 / self.cut.edge));
        if !cell.is_some_and(|&cell| self.cells[cell].reached) {
            return 0.0;
        }
        self.sight.as_ref().map_or(1.0, |sight| sight.shares[1][row]) * self.query.support.at(&place)
    }
}
