//! Growth of a verified pose over the whole overlap: rigid patches, then a smooth displacement.
//!
//! One rigid transform for a row does not exist (drift, sag; paper, section III-C), so the query is cut into cells.
//! Each cell has its own pose ([`super::patches`]). Growth goes from cell to neighbouring cell and stops where the
//! evidence turns. What it finds is settled once more before it is reported ([`super::settlement`]).

use super::cut::{Cell, Cut};
use super::hypothesis::{Hypothesis, Model};
use super::landscape::Landscape;
use super::placement::{Landing, Moments, Placement};
use super::search::REACH;
use super::sight::unseen;
use nalgebra::Vector3;

/// Growth ends at the latest after this many steps from cell to cell beyond the extent of the cloud.
const EXTRA_ROUNDS: usize = 6;

/// The first rounds look further than the noise.
const WIDENING: [f64; 4] = [2.0, 2.0, 1.6, 1.3];

/// The first rounds fit one rigid pose: patches would bend towards a seed that is turned by a few degrees.
const RIGID_ROUNDS: usize = 6;

/// Rounds of pairing and fitting when the pose is known for the whole query, and once fruits or cells were left out of it.
const WHOLE_ROUNDS: usize = 2;

/// Evidence in nats of a cell and its neighbours that lets growth go on from there.
const CONVINCING: f64 = 2.0;

/// The nearest fruit of the map, while growth goes on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Partner {
    pub(super) row: u32,
    /// From the place that the patch predicts, metres of the map.
    pub(super) residual: Vector3<f64>,
    /// Probability that it is no stranger.
    pub(super) weight: f64,
}

/// A pose that grows over the cells of the query.
#[derive(Debug)]
pub(crate) struct Growth<'a> {
    pub(super) query: &'a Landscape,
    pub(super) map: &'a Landscape,
    pub(super) model: Model,
    pub(super) cells: Vec<Cell>,
    pub(super) cut: &'a Cut,
    /// Sums around every cell that was reached when pairs were made last.
    pub(super) wide: Vec<Option<Moments>>,
    pub(super) edge: f64,
    pub(super) pose: Placement,
    pub(super) sigma: f64,
    /// Variance of the displacement that neighbours share, square metres.
    pub(super) shared: f64,
    pub(super) predictions: Vec<Option<Landing>>,
    pub(super) partners: Vec<Option<Partner>>,
    pub(super) owner: Vec<Option<u32>>,
    /// Fruits of the query, and of the map, that hang where the other visit does not see; empty where all are seen.
    pub(super) unseen: [Vec<bool>; 2],
    pub(super) patch_places: Vec<Vector3<f64>>,
    /// The pose is known to hold everywhere and the noise is given.
    pub(super) whole: bool,
    /// Factor on the standard deviation of the predictions, to leave a seed's local optimum.
    pub(super) widening: f64,
    /// Patches follow the common pose.
    pub(super) rigid: bool,
}

/// Grows a hypothesis as far as the evidence goes.
pub(crate) fn grow<'a>(query: &'a Landscape, map: &'a Landscape, seed: &Hypothesis, model: &Model) -> Growth<'a> {
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
pub(crate) fn hold<'a>(query: &'a Landscape, map: &'a Landscape, whole: &Hypothesis, model: &Model) -> Growth<'a> {
    let mut growth = Growth::new(query, map, whole, model);
    growth.whole = true;
    for cell in &mut growth.cells {
        cell.reached = true;
    }
    growth.predict();
    growth.pair_up();
    growth.go_on();
    growth
}

/// Pairs under a pose of the whole query that few of its fruits say: those that only one visit sees are left out, and
/// cells that say nothing fall out in the end.
pub(crate) fn lay<'a>(query: &'a Landscape, map: &'a Landscape, whole: &Hypothesis, model: &Model) -> Growth<'a> {
    let mut growth = hold(query, map, whole, model);
    growth.unseen = unseen(query, map, &growth.pose);
    let hidden: Vec<usize> = (0..query.len()).filter(|&row| growth.unseen[0][row]).collect();
    for row in hidden {
        growth.forget(row);
    }
    growth.pair_up();
    growth.go_on();
    growth.whole = false;
    growth
}

impl<'a> Growth<'a> {
    fn new(query: &'a Landscape, map: &'a Landscape, seed: &Hypothesis, model: &Model) -> Self {
        let cut = query.cut();
        let mut cells = cut.cells.clone();
        let far = |cell: &Cell| (cell.centre - seed.place).norm();
        for cell in &mut cells {
            cell.pose = seed.pose;
            cell.reached = far(cell) < REACH * query.spacing;
        }
        if let Some(nearest) = cells.iter_mut().min_by(|a, b| far(a).total_cmp(&far(b))) {
            nearest.reached = true;
        }
        Self {
            query,
            map,
            model: *model,
            wide: vec![None; cells.len()],
            cells,
            cut,
            edge: cut.edge,
            pose: seed.pose,
            sigma: seed.sigma,
            shared: 0.0,
            predictions: vec![None; query.len()],
            partners: vec![None; query.len()],
            owner: vec![None; map.len()],
            unseen: Default::default(),
            patch_places: vec![Vector3::zeros(); query.len()],
            whole: false,
            widening: 1.0,
            rigid: false,
        }
    }

    /// Reaches the neighbours of cells whose surroundings speak for the pose; returns whether any is new.
    fn spread(&mut self) -> bool {
        let mut new = Vec::new();
        for (i, cell) in self.cells.iter().enumerate().filter(|(_, cell)| cell.reached) {
            let beyond = |&&(other, closeness): &&(u32, f64)| closeness > 0.3 && !self.cells[other as usize].reached;
            let mut beyond = cell.around.iter().filter(beyond).peekable();
            if beyond.peek().is_some() && self.convincing(i) {
                new.extend(beyond.map(|&(other, _)| (other as usize, cell.pose)));
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

    /// Fits to the pairs and makes them anew.
    fn go_on(&mut self) {
        for _ in 0..WHOLE_ROUNDS {
            self.refit();
            self.predict();
            self.pair_up();
        }
    }

    /// Leaves a fruit out, with its partner.
    fn forget(&mut self, row: usize) {
        self.predictions[row] = None;
        if let Some(partner) = self.partners[row].take() {
            self.owner[partner.row as usize] = None;
        }
    }

    /// Fruits of the reached cells.
    pub(super) fn active(&self) -> Vec<u32> {
        self.cells.iter().filter(|cell| cell.reached).flat_map(|cell| cell.rows.iter().copied()).collect()
    }

    /// Whether a reached cell and its neighbours together have evidence for the pose.
    pub(super) fn convincing(&self, i: usize) -> bool {
        let cell = &self.cells[i];
        self.whole
            || cell.reached
                && cell.around.iter().map(|a| a.1 * self.cells[a.0 as usize].log_odds).sum::<f64>() > CONVINCING
    }

    /// Looks once at the cells that growth did not reach: a crown may be cut off by a gap without fruits.
    ///
    /// They add pairs where they convince, but nothing to the evidence, which would be the better of two tries.
    pub(crate) fn reach_all(&mut self) {
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
            let rows = self.cells[i].rows.clone();
            rows.iter().for_each(|&row| self.forget(row as usize));
        }
        self.go_on();
    }
}
