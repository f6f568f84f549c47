//! The last word on patches and noise, before pairs are reported.
//!
//! Growth goes by nearest partners. Where fruits crowd, the nearest is often a stranger, and a patch that is fitted to
//! strangers meets them ever closer: the noise comes out small, the pairs surer than they are. So what growth found is
//! settled once more, in turns:
//!
//! 1. Every fruit is predicted without its own partner (leave-one-out).
//! 2. The noise comes from distances, nobody said to be who ([`super::scatter`]).
//! 3. Every pair gets its probability ([`super::pairing`]); their sum says the share of the next turn.
//! 4. Patches are fitted to the mean partners under these probabilities, each held to its surroundings and these to
//!    the common pose as firmly as the clouds show that they move together.

use super::cut::{Cell, Cut, key_of, surroundings, total};
use super::displacement::{carried_on, shared_by_neighbours};
use super::evidence::evidence;
use super::growth::{Growth, Partner};
use super::hypothesis::{DETECTION, Model, SHARES};
use super::landscape::Landscape;
use super::nearest::SHARE_OF_ROWS;
use super::overlap::Overlap;
use super::pairing::{Laid, Marginals};
use super::patches::{Footing, HOLD, SHARE_OF_CELLS, next_to};
use super::placement::{Landing, Moments, Placement};
use super::scatter::{GIVEN, GUESSED, KnownNoise, scatter};
use super::sight::is_among;
use super::size::{Cue, Diameters};
use crate::geometry::Scale;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Turns: the noise stands after the first, the patches after the second; then what a branch shows near its stem leads on to
/// its tip, a few fruits a turn.
const TURNS: usize = 4;

/// Pairs that hold a patch to its surroundings, and these to the common pose, at the least; and where neighbours do not
/// differ from them together.
const HOLDS: (f64, f64) = (0.5, 1000.0);

/// A prediction loses at most this share of its fit when its own partner is left out.
const MAX_LEVERAGE: f64 = 0.8;

/// The overlap as it stands in the end.
pub(crate) struct Settled {
    pub(crate) overlap: Overlap,
    /// Pairs by their probabilities.
    pub(crate) marginals: Marginals,
    /// What speaks for the pose when every fruit is predicted without its own partner, nats ([`super::evidence`]).
    pub(crate) evidence: f64,
}

/// Mean partner of a fruit, and the probability that it has one.
type Target = Option<(Vector3<f64>, f64)>;

struct Settlement<'a> {
    query: &'a Landscape,
    map: &'a Landscape,
    model: Model,
    expected: KnownNoise,
    cells: Vec<Cell>,
    cut: &'a Cut,
    edge: f64,
    pose: Placement,
    /// Noise of a pair under a pose that is known exactly, metres of the map.
    sigma: f64,
    /// Probability that a fruit which the map could have shown is there, as the pairs show it.
    share: f64,
    /// Pairs that hold the patches, and their surroundings.
    holds: [f64; 2],
    /// Variance that neighbours' residuals about the patches share, square metres.
    shared: f64,
    targets: Vec<Target>,
    predictions: Vec<Option<Landing>>,
    /// Fruits of the query, and of the map, that hang where the other visit does not see; empty where all are seen.
    unseen: [&'a [bool]; 2],
}

/// Settles what `growth` found; `noise_m` is the relative noise where it is known.
pub(crate) fn settle(growth: &Growth, noise_m: Option<f64>, sizes: Option<&Diameters>) -> Settled {
    let mut settlement = Settlement::new(growth, noise_m);
    let mut marginals = settlement.paired(None);
    for _ in 0..TURNS {
        let cue = sizes.and_then(|sizes| sizes.cue(marginals.links()));
        settlement.recount(&marginals);
        settlement.refit(&marginals);
        marginals = settlement.paired(cue.as_ref());
    }
    let evidence = settlement.evidence();
    let overlap = Overlap {
        pose: settlement.pose,
        sigma: settlement.sigma,
        predictions: settlement.predictions,
        ..growth.overlap()
    };
    Settled { overlap, marginals, evidence }
}

impl<'a> Settlement<'a> {
    fn new(growth: &'a Growth, noise_m: Option<f64>) -> Self {
        let target = |partner: &Partner| (growth.map.points[partner.row as usize], partner.weight);
        Self {
            query: growth.query,
            map: growth.map,
            model: growth.model,
            expected: match noise_m {
                Some(sigma) => KnownNoise { sigma, width: GIVEN },
                None if growth.whole => KnownNoise { sigma: growth.sigma, width: GIVEN },
                None => KnownNoise { sigma: growth.model.sigma, width: GUESSED },
            },
            cells: growth.cells.clone(),
            cut: growth.cut,
            edge: growth.edge,
            pose: growth.pose,
            sigma: growth.sigma,
            share: DETECTION,
            holds: [HOLD; 2],
            shared: growth.shared,
            targets: growth.partners.iter().map(|partner| partner.as_ref().map(target)).collect(),
            predictions: vec![None; growth.query.len()],
            unseen: growth.unseen.each_ref().map(Vec::as_slice),
        }
    }

    fn laid(&self) -> Laid<'_> {
        Laid { query: self.query, map: self.map, predictions: &self.predictions, pose: &self.pose }
    }

    /// From the mean partner to where the patch puts the fruit.
    fn residual(&self, row: usize) -> Target {
        let (target, weight) = self.targets[row]?;
        let pose = &self.cells[self.cut.cell_of[row] as usize].pose;
        Some((target - pose.apply(&self.query.points[row]), weight))
    }

    /// Where each fruit should lie by all partners but its own, and how surely.
    fn predict(&mut self) {
        let footing = |moments: Moments, hold: f64, cell: &Cell| Footing::new(&moments, hold, self.edge, cell.centre);
        let footings: Vec<Option<[Footing; 2]>> = self
            .cells
            .par_iter()
            .with_min_len(SHARE_OF_CELLS)
            .map(|cell| {
                cell.reached.then(|| {
                    let near = footing(next_to(&self.cells, cell), self.holds[0], cell);
                    [near, footing(surroundings(&self.cells, cell), self.holds[1], cell)]
                })
            })
            .collect();
        let at = |row: usize| {
            let footing = footings[self.cut.cell_of[row] as usize].filter(|_| !is_among(self.unseen[0], row))?;
            Some(self.prediction(row, &footing))
        };
        self.predictions = (0..self.query.len()).into_par_iter().with_min_len(SHARE_OF_ROWS).map(at).collect();
    }

    fn prediction(&self, row: usize, [near, wide]: &[Footing; 2]) -> Landing {
        let p = self.query.points[row];
        // The patch follows its surroundings in the measure in which it is held to them.
        let looseness = near.looseness(&p) + near.share_held(self.holds[0]) * wide.looseness(&p);
        let noise = self.sigma * self.sigma;
        let (shift, unexplained) = carried_on(self.query, row, (self.shared, noise), |other| self.residual(other));
        let mut place = self.cells[self.cut.cell_of[row] as usize].pose.apply(&p) + shift;
        if let Some((residual, weight)) = self.residual(row) {
            // Of a linear fit: the residual without the own partner is r / (1 - h), h the leverage.
            let leverage = (weight * looseness).min(MAX_LEVERAGE);
            place -= residual * (leverage / (1.0 - leverage));
        }
        Landing { place, variance: noise * (1.0 + looseness) + unexplained }
    }

    /// Noise from the distances; the predictions' variances follow.
    fn measure(&mut self) {
        let found = scatter(&self.laid(), self.expected);
        let both = self.predictions.iter().zip(&self.targets);
        let (sum, weights) = both
            .filter_map(|(prediction, target)| Some((prediction.as_ref()?.variance, (*target)?.1)))
            .fold((0.0, 0.0), |sum, (variance, weight)| (sum.0 + weight * variance, sum.1 + weight));
        if weights > 0.0 {
            let stretch = found * found * weights / sum;
            self.sigma *= stretch.sqrt();
            self.predictions.iter_mut().flatten().for_each(|prediction| prediction.variance *= stretch);
        }
    }

    /// The share as the pairs show it: a step of expectation and maximisation a turn.
    ///
    /// The distances of all fruits together do not know who hangs alone and who in a crowd; the pairs do, and err
    /// less. All the way they would take too little where fruits crowd within the noise.
    fn recount(&mut self, marginals: &Marginals) {
        let due: f64 = self.predictions.iter().flatten().map(|at| self.map.support(&at.place)).sum();
        let found: f64 = marginals.links().map(|link| link.probability).sum();
        self.share = ((found + 1.0) / (due + 2.0)).clamp(SHARES.0, SHARES.1);
    }

    /// Predictions, noise and pairs under the poses as they are fitted now.
    fn paired(&mut self, cue: Option<&Cue>) -> Marginals {
        self.predict();
        self.measure();
        let size = |query: u32, map: u32| cue.map_or(1.0, |cue| cue.ratio(query, map));
        Marginals::new(&self.laid(), self.share, &size)
    }

    /// What the overlap says for the pose, nats.
    fn evidence(&self) -> f64 {
        let support = |(row, p): (usize, &Vector3<f64>)| {
            if is_among(self.unseen[1], row) {
                return 0.0;
            }
            let place = self.pose.apply_inverse(p);
            let cell = self.cut.index.get(&key_of(&place, self.edge));
            if cell.is_some_and(|&cell| self.cells[cell].reached) { self.query.support(&place) } else { 0.0 }
        };
        let there: Vec<f64> = self.map.points.iter().enumerate().map(support).collect();
        evidence(&self.laid(), &there)
    }

    /// Common pose, surroundings and patches from the mean partners.
    fn refit(&mut self, marginals: &Marginals) {
        self.follow(marginals);
        let all = total(self.cells.iter().map(|cell| (&cell.moments, 1.0)));
        self.pose = self.model.step(&all, &self.pose, self.sigma).unwrap_or(self.pose);
        self.cells.iter_mut().for_each(|cell| cell.pose = self.pose);
        self.holds[1] = self.hold();
        self.fit(surroundings, self.holds[1]);
        self.holds[0] = self.hold();
        self.fit(next_to, self.holds[0]);
        self.shared = self.shared();
    }

    /// Mean partners by the probabilities, and their sums in every cell.
    fn follow(&mut self, marginals: &Marginals) {
        let mut sums = vec![(Vector3::zeros(), 0.0); self.query.len()];
        for link in marginals.links() {
            let sum = &mut sums[link.query as usize];
            sum.0 += self.map.points[link.map as usize] * link.probability;
            sum.1 += link.probability;
        }
        let mean = |(sum, weight): (Vector3<f64>, f64)| (weight > 0.0).then(|| (sum / weight, weight));
        self.targets = sums.into_iter().map(mean).collect();
        let (query, targets) = (self.query, &self.targets);
        for cell in self.cells.iter_mut().filter(|cell| cell.reached) {
            cell.moments = Moments::default();
            for &row in cell.rows.iter() {
                if let Some((target, weight)) = targets[row as usize] {
                    cell.moments.add(&query.points[row as usize], &target, weight);
                }
            }
        }
    }

    /// Pairs that hold a pose to the one above it: noise over the variance by which neighbours differ from that
    /// together.
    fn hold(&self) -> f64 {
        (self.sigma * self.sigma / self.shared().max(f64::MIN_POSITIVE)).clamp(HOLDS.0, HOLDS.1)
    }

    /// Variance that neighbours' residuals about the cells' poses share, square metres.
    fn shared(&self) -> f64 {
        shared_by_neighbours(self.query, self.sigma, |row| self.residual(row))
    }

    /// Fits every cell's pose to the pairs around it, held to the pose that it has.
    fn fit(&mut self, around: impl Fn(&[Cell], &Cell) -> Moments + Sync, hold: f64) {
        let prior = hold * self.edge * self.edge;
        let fitted = |cell: &Cell| {
            let mut moments = around(&self.cells, cell);
            moments.add(&cell.centre, &cell.pose.apply(&cell.centre), hold);
            moments.step(&cell.pose, Scale::Metric, prior).unwrap_or(cell.pose)
        };
        let poses: Vec<Placement> = self.cells.par_iter().with_min_len(SHARE_OF_CELLS).map(fitted).collect();
        self.cells.iter_mut().zip(poses).for_each(|(cell, pose)| cell.pose = pose);
    }
}
