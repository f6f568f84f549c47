//! What a growth explains, and how much evidence it has.

use super::cut::{key_of, total};
use super::growth::{Growth, Partner};
use super::hypothesis::gaussian;
use super::placement::{Landing, Placement};
use super::sight::is_among;
use nalgebra::Vector3;

/// Shares of fruits seen again that are tried: heavy occlusion to a bare tree.
const SHARES_SEEN_AGAIN: [f64; 4] = [0.35, 0.55, 0.75, 0.9];

/// The overlap that a hypothesis explains.
#[derive(Debug, Clone)]
pub(crate) struct Overlap {
    /// Least-squares pose over all pairs.
    pub(crate) pose: Placement,
    /// Evidence summed over all cells that growth reached, nats.
    pub(crate) log_odds: f64,
    /// Relative noise per axis, metres of the map.
    pub(crate) sigma: f64,
    /// Centroid of the matched fruits, in the centred query.
    pub(crate) middle: Vector3<f64>,
    /// Where each fruit of the query is expected; `None` outside the overlap.
    pub(crate) predictions: Vec<Option<Landing>>,
}

impl Growth<'_> {
    /// What the growth explains now.
    pub(crate) fn overlap(&self) -> Overlap {
        let mut predictions = self.predictions.clone();
        for i in (0..self.cells.len()).filter(|&i| !self.convincing(i)) {
            for &row in self.cells[i].rows.iter() {
                predictions[row as usize] = None;
            }
        }
        let all = total(self.cells.iter().filter(|c| c.reached).map(|c| (&c.moments, 1.0)));
        let middle = if all.weight > 0.0 { all.centroid() } else { Vector3::zeros() };
        Overlap { middle, pose: self.pose, log_odds: self.log_odds(), sigma: self.sigma, predictions }
    }

    /// Evidence of the cells that growth reached, both sides counted (see `Refiner::other_side`), under the share of
    /// fruits seen again that suits it best.
    fn log_odds(&self) -> f64 {
        let here: Vec<(f64, f64)> = self
            .predictions
            .iter()
            .zip(&self.partners)
            .filter_map(|(prediction, partner)| prediction.map(|at| (at, partner)))
            .map(|(at, partner)| {
                let ratio = partner.map_or(f64::NAN, |Partner { row, .. }| {
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
            .enumerate()
            .filter(|(row, (_, owner))| owner.is_none() && !is_among(&self.unseen[1], *row))
            .map(|(_, (p, _))| self.pose.apply_inverse(p))
            .filter(|place| self.cut.index.get(&key_of(place, self.edge)).is_some_and(|&cell| self.cells[cell].reached))
            .map(|place| self.query.support(&place))
            .collect()
    }
}
