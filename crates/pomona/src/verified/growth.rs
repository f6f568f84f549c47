//! Growth of a verified pose over the whole overlap: rigid patches, then a smooth displacement.
//!
//! One rigid transform for a row does not exist (drift, sag; paper, section III-C), so the query is cut into cells.
//! Each cell has its own pose ([`super::patches`]). Growth goes from cell to neighbouring cell and stops where the
//! evidence turns. What it finds is settled once more before it is reported ([`super::settlement`]).

use super::claims::Claims;
use super::cut::Cell;
use super::hypothesis::{GATE, Hypothesis, Model, TURNS};
use super::landscape::Landscape;
use super::patches::{ALL, Landing, NEXT, Patchwork};
use super::search::REACH;
use crate::neighbours::others::each_row;

/// How many times further than the noise the first rounds look. They fit one rigid pose: patches would bend towards a
/// seed that is turned by a few degrees.
const RIGID: [f64; 6] = [2.0, 2.0, 1.6, 1.3, 1.0, 1.0];

/// Rounds of pairing and fitting when the pose is known for the whole query, and once fruits or cells were left out of it.
const WHOLE_ROUNDS: usize = 2;

/// A patch, and its surroundings, may differ from the pose that they had as if this many pairs held them to it.
pub(super) const HOLD: f64 = 2.0;

/// Rounds after which a cell rests once it and those around it are reached: what pairs and patches make of each other has settled
/// by then, and a long row costs no more for each of its trees than a short one.
const SETTLES: usize = 6;

/// Evidence in nats of a cell and its neighbours that lets growth go on from there.
pub(super) const CONVINCING: f64 = 2.0;

/// A pose that grows over the cells of the query.
#[derive(Debug, Clone)]
pub(crate) struct Growth<'a> {
    pub(super) patches: Patchwork<'a>,
    /// The nearest fruit of the map, where no other fruit of the query is likelier to be it.
    pub(super) partners: Vec<Option<u32>>,
    /// The nearest fruit of the map, and the likelihood ratio of the two being one.
    nearest: Vec<Option<(u32, f64)>>,
    /// What every fruit says, nats.
    gains: Vec<f64>,
    /// Evidence of every cell that is reached, nats.
    log_odds: Vec<f64>,
    /// Rounds of pairing so far, and after which of them each cell or one around it was reached last, or to be looked at again.
    round: usize,
    touched: Vec<usize>,
    /// The cells that were reached in the last round.
    reached: Vec<bool>,
    /// The pose is known to hold everywhere, and the noise is not what its pairs show.
    pub(super) whole: bool,
    /// Noise under which all fruits together say most, metres of the map, where they were asked.
    pub(super) sharpest: Option<f64>,
}

/// Grows a hypothesis as far as the evidence goes.
pub(crate) fn grow<'a>(query: &'a Landscape, map: &'a Landscape, seed: &Hypothesis, model: &Model) -> Growth<'a> {
    let mut growth = Growth::new(query, map, seed, model);
    let extent = growth.patches.cells.iter().fold(0.0f64, |far, cell| far.max((cell.centre - seed.place).norm()));
    // Two steps for each cell of the way.
    let most = (extent / growth.patches.cut.edge) as usize * 2 + RIGID.len();
    let mut settled = 0;
    for round in 0..most {
        let rigid = RIGID.get(round);
        growth.meet(rigid.copied().unwrap_or(1.0));
        growth.refit(rigid.is_some());
        settled = if growth.spread() { 0 } else { settled + 1 };
        if settled > 0 || rigid.is_some() {
            growth.wake();
        }
        if settled >= TURNS && round > RIGID.len() + 2 {
            break;
        }
    }
    growth.meet(1.0);
    growth
}

/// Pairs under a pose that holds for the whole query, with the noise as it is given.
pub(crate) fn hold<'a>(query: &'a Landscape, map: &'a Landscape, whole: &Hypothesis, model: &Model) -> Growth<'a> {
    let mut growth = Growth::new(query, map, whole, model);
    growth.whole = true;
    growth.patches.cells.iter_mut().for_each(|cell| cell.reached = true);
    growth.meet(1.0);
    growth.go_on();
    growth
}

/// Pairs under a pose of the whole query that few of its fruits say: each counts as far as the other visit can have seen it, and
/// cells that say nothing fall out in the end.
pub(crate) fn lay<'a>(query: &'a Landscape, map: &'a Landscape, whole: &Hypothesis, model: &Model) -> Growth<'a> {
    let mut growth = hold(query, map, whole, model);
    growth.patches.sight = model.sight(query, map, &growth.patches.pose);
    growth.meet(1.0);
    growth.go_on();
    growth.whole = false;
    growth
}

impl<'a> Growth<'a> {
    fn new(query: &'a Landscape, map: &'a Landscape, seed: &Hypothesis, model: &Model) -> Self {
        let mut patches = Patchwork::new(query, map, seed.pose, seed.sigma, model);
        let far = |cell: &Cell| (cell.centre - seed.place).norm();
        for cell in &mut patches.cells {
            cell.reached = far(cell) < REACH * query.spacing;
        }
        if let Some(nearest) = patches.cells.iter_mut().min_by(|a, b| far(a).total_cmp(&far(b))) {
            nearest.reached = true;
        }
        let (fruits, cells) = (query.len(), patches.cells.len());
        Self {
            patches,
            partners: vec![None; fruits],
            nearest: vec![None; fruits],
            gains: vec![0.0; fruits],
            log_odds: vec![0.0; cells],
            round: 0,
            touched: vec![0; cells],
            reached: vec![false; cells],
            whole: false,
            sharpest: None,
        }
    }

    /// All cells are to be looked at again.
    fn wake(&mut self) {
        self.touched.fill(self.round);
    }

    /// A new round, in which those cells rest around which none was reached, or given up, for some rounds.
    fn begin(&mut self) {
        for (i, cell) in self.patches.cells.iter().enumerate() {
            if cell.reached != self.reached[i] {
                self.reached[i] = cell.reached;
                cell.around.iter().for_each(|&(other, _)| self.touched[other as usize] = self.round);
            }
        }
        for (cell, touched) in self.patches.cells.iter_mut().zip(&self.touched) {
            cell.at_rest = self.round > touched + SETTLES;
        }
        self.round += 1;
    }

    /// Predicts the fruits of the reached cells, and finds their nearest partners; of several claims on one fruit the likeliest
    /// wins.
    pub(super) fn meet(&mut self, widening: f64) {
        self.begin();
        self.patches.predict(
            |patches, cell| patches.footing(cell, ALL, HOLD),
            |patches, row, footing| patches.landing(row, footing.looseness(&patches.query.points[row]), widening),
        );
        let Patchwork { map, model, cut, .. } = self.patches;
        let rests = |row: usize| self.patches.cells[cut.cell_of[row] as usize].is_at_rest();
        let nearest = |row: usize| {
            if rests(row) { self.nearest[row] } else { self.nearest_to(row, self.patches.predictions[row].as_ref()?) }
        };
        self.nearest = each_row(self.partners.len(), nearest);
        let mut claims = Claims::on(map.len());
        for (row, nearest) in self.nearest.iter().enumerate() {
            if let Some((partner, ratio)) = *nearest {
                claims.claim(partner, row, ratio);
            }
        }
        for row in 0..self.partners.len() {
            let kept = self.nearest[row].filter(|met| claims.owner(met.0) == Some(row));
            let partner = kept.map(|(partner, _)| partner);
            if partner == self.partners[row] && self.patches.cells[cut.cell_of[row] as usize].is_at_rest() {
                continue;
            }
            self.gains[row] = kept.map_or_else(|| self.alone(row), |(_, ratio)| ratio.ln());
            self.partners[row] = partner;
            let model = model.of_share(self.patches.share_seen(row));
            let target =
                |(partner, ratio): (u32, f64)| (map.points[partner as usize], model.no_stranger(ratio).max(0.0));
            self.patches.targets[row] = kept.map(target);
        }
        self.patches.look();
        self.patches.sum_up();
        let of_cell = |cell: &Cell| cell.rows.iter().map(|&row| self.gains[row as usize]).sum();
        self.log_odds = self.patches.cells.iter().map(of_cell).collect();
    }

    /// The fruit of the map nearest to where one is expected, and the likelihood ratio of the two being one.
    fn nearest_to(&self, row: usize, Landing { place, variance }: &Landing) -> Option<(u32, f64)> {
        let Patchwork { map, model, .. } = self.patches;
        let (partner, d2) = map.nearest(place, GATE * variance.sqrt())?;
        let model = model.of_share(self.patches.share_seen(row));
        Some((partner, model.met(d2, *variance, map.density[partner as usize])))
    }

    /// What a fruit without a partner says, nats.
    fn alone(&self, row: usize) -> f64 {
        let Patchwork { model, predictions, .. } = &self.patches;
        predictions[row].map_or(0.0, |at| model.missed(self.patches.shown(row, &at.place)).ln())
    }

    /// New poses, noise and shared displacement from the current pairs: one `rigid` pose, or patches.
    pub(super) fn refit(&mut self, rigid: bool) {
        let patches = &mut self.patches;
        if !patches.fit_as_one() {
            return;
        }
        if rigid {
            patches.stiffen();
        } else {
            patches.bend(|_| HOLD);
        }
        if !self.whole {
            // What was left over before the patches moved: it goes too far in each round, and so reaches the tips of branches in
            // fewer.
            let (squares, weight) = patches.share();
            patches.sigma = patches.model.noise(squares, weight);
        }
    }

    /// Reaches the neighbours of cells whose surroundings speak for the pose; returns whether any is new.
    pub(super) fn spread(&mut self) -> bool {
        let cells = &self.patches.cells;
        let mut new = Vec::new();
        for (i, cell) in cells.iter().enumerate().filter(|(_, cell)| cell.reached) {
            let beyond = |&&(other, closeness): &&(u32, f64)| closeness > NEXT && !cells[other as usize].reached;
            let mut beyond = cell.around.iter().filter(beyond).peekable();
            if beyond.peek().is_some() && self.convincing(i) {
                new.extend(beyond.map(|&(other, _)| (other as usize, cell.pose)));
            }
        }
        for &(i, pose) in &new {
            let cell = &mut self.patches.cells[i];
            if !cell.reached {
                (cell.reached, cell.pose) = (true, pose);
            }
        }
        !new.is_empty()
    }

    /// Fits to the pairs and makes them anew.
    pub(super) fn go_on(&mut self) {
        self.wake();
        for _ in 0..WHOLE_ROUNDS {
            self.refit(false);
            self.meet(1.0);
        }
    }

    /// Whether a reached cell and its neighbours together have evidence for the pose.
    pub(super) fn convincing(&self, i: usize) -> bool {
        let cell = &self.patches.cells[i];
        let around = || cell.around.iter().map(|&(other, closeness)| closeness * self.log_odds[other as usize]);
        self.whole || cell.reached && around().sum::<f64>() > CONVINCING
    }
}
