//! What a growth explains, and how much evidence it has.

use super::growth::Growth;
use super::patches::Landing;
use super::shares::{likeliest_share, of_either};
use crate::geometry::Similarity;
use crate::statistics::gaussian;
use nalgebra::Vector3;

/// The overlap that a hypothesis explains.
#[derive(Debug, Clone)]
pub(crate) struct Overlap {
    /// Least-squares pose over all pairs.
    pub(crate) pose: Similarity,
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
        let mut predictions = self.patches.predictions.clone();
        for (_, cell) in self.patches.cells.iter().enumerate().filter(|(i, _)| !self.convincing(*i)) {
            cell.rows.iter().for_each(|&row| predictions[row as usize] = None);
        }
        let all = self.patches.all_pairs();
        let middle = if all.weight > 0.0 { all.centroid() } else { Vector3::zeros() };
        let (pose, sigma) = (self.patches.pose, self.patches.sigma);
        Overlap { middle, pose, log_odds: self.log_odds(), sigma, predictions }
    }

    /// Evidence of the cells that growth reached, both sides counted (see `Refiner::other_side`), under the share of
    /// fruits seen again that suits it best.
    fn log_odds(&self) -> f64 {
        let (map, partners) = (self.patches.map, &self.partners);
        let shown: Vec<f64> = self
            .patches
            .predictions
            .iter()
            .enumerate()
            .map(|(row, at)| at.map_or(0.0, |at| self.patches.shown(row, &at.place)))
            .collect();
        let looked_at: Vec<f64> = (0..map.len()).map(|row| self.patches.looked_at(row)).collect();
        let [of_query, of_map] = of_either(1.0, [&shown, &looked_at].map(|all| all.iter().sum()));
        // A fruit of the query that meets its partner has 1 + p x, x by how much that is likelier than a stranger; one that is alone
        // 1 - p u, u how surely it would be seen: -u is its x.
        let mut terms = Vec::new();
        for (row, (at, partner)) in self.patches.predictions.iter().zip(partners).enumerate() {
            let Some(at) = at else { continue };
            terms.push(
                of_query
                    * partner.map_or(-shown[row], |partner| {
                        let d2 = (map.points[partner as usize] - at.place).norm_squared();
                        self.patches.share_seen(row) * (gaussian(d2, at.variance) / map.density[partner as usize] - 1.0)
                    }),
            );
        }
        let mut found = vec![false; map.len()];
        partners.iter().flatten().for_each(|&partner| found[partner as usize] = true);
        let missed = looked_at.iter().zip(found).filter(|(support, found)| !found && **support > 0.0);
        terms.extend(missed.map(|(support, _)| -of_map * support));
        let due = of_query * shown.iter().sum::<f64>();
        // The evidence is concave in the share.
        let slope = |share: f64| due + terms.iter().map(|x| x / (1.0 + share * x)).sum::<f64>();
        let share = likeliest_share(slope);
        share * due + terms.iter().map(|x| (share * x).ln_1p()).sum::<f64>()
    }
}
