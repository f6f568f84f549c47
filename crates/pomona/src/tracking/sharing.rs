//! Boxes that are not one fruit: a second piece of a fruit that a leaf divides, and one outline around two fruits.
//!
//! Neither may start a fruit, and a box around two must not move either of them.

use super::association::Association;
use super::config::TrackingConfig;
use super::observation::Observation;
use super::prediction::{Appearance, Prediction};
use super::sphere::Interval;

/// Overlap of two boxes over the smaller one above which they are not two pieces beside each other.
const BESIDE: f64 = 0.2;

/// Nats by which the outline of two must explain a box better than the outline of one: twenty to one.
const CLEARLY: f64 = 3.0;

/// What a box is.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Role {
    /// It shows a known fruit, by prediction.
    Known(usize),
    /// It is around two known fruits; the first counts as seen.
    Shared([usize; 2]),
    /// A second piece of a fruit that another box shows.
    Piece,
    /// None of those.
    New,
}

/// What each box is.
pub(crate) fn roles(
    predictions: &[Prediction],
    observations: &[Observation],
    association: &Association,
    config: &TrackingConfig,
) -> Vec<Role> {
    let role = |o: usize| {
        let shared = shared_by(o, predictions, observations, association, config);
        match (shared, association.prediction_of[o]) {
            (Some(both), _) => Role::Shared(both),
            (None, Some(p)) => Role::Known(p),
            (None, None) if is_second_piece(o, predictions, observations, association, config) => Role::Piece,
            (None, None) => Role::New,
        }
    };
    (0..observations.len()).map(role).collect()
}

/// Whether a box without a fruit is a second piece of one that another box shows.
///
/// Both pieces lie within the predicted outline, beside each other, and the depth of the second, where there is one, is
/// that fruit's: another fruit that shows within this one's outline hangs in front of it.
fn is_second_piece(
    o: usize,
    predictions: &[Prediction],
    observations: &[Observation],
    association: &Association,
    config: &TrackingConfig,
) -> bool {
    predictions.iter().enumerate().any(|(p, prediction)| {
        let (Some(first), Some(weighed)) = (association.box_of[p], association.weighed.get(&(p, o))) else {
            return false;
        };
        let (piece, main) = (&observations[o], &observations[first]);
        weighed.log_odds > 0.0
            && (piece.lift.is_none() || weighed.likely.is_some_and(|likely| likely.depth_fits > 0.5))
            && lies_within(piece, &prediction.likely, config)
            && lies_within(main, &prediction.likely, config)
            && are_beside(piece, main)
    })
}

fn lies_within(observation: &Observation, appearance: &Appearance, config: &TrackingConfig) -> bool {
    (0..2).all(|axis| {
        let margin = 2.0 * edge_variance(appearance, axis, config).sqrt();
        appearance.outline[axis].contains(observation.sides[axis].edges, margin)
    })
}

fn are_beside(a: &Observation, b: &Observation) -> bool {
    let area = |sides: [Interval; 2]| sides.iter().map(|side| side.high - side.low).product::<f64>();
    let [a, b] = [a, b].map(|one| one.sides.map(|side| side.edges));
    let overlap: f64 = a.iter().zip(&b).map(|(x, y)| x.overlap(*y)).product();
    overlap < BESIDE * area(a).min(area(b))
}

/// The fruits whose outlines together, but not one alone, explain a box: the one that it is assigned to, if any, or the
/// nearest first.
fn shared_by(
    o: usize,
    predictions: &[Prediction],
    observations: &[Observation],
    association: &Association,
    config: &TrackingConfig,
) -> Option<[usize; 2]> {
    let observation = &observations[o];
    let free: Vec<usize> = (0..predictions.len())
        .filter(|&p| association.box_of[p].is_none() && middle_lies_in(observation, &predictions[p].likely))
        .collect();
    let firsts = match association.prediction_of[o] {
        Some(p) => vec![p],
        None => free.clone(),
    };
    let mut best = (CLEARLY, None);
    for &first in &firsts {
        for &second in free.iter().filter(|&&second| second != first) {
            let [a, b] = [&predictions[first].likely, &predictions[second].likely];
            let alone = edges_log_density(observation, a, a, config).max(edges_log_density(observation, b, b, config));
            let gain = edges_log_density(observation, a, b, config) - alone;
            if gain > best.0 && depth_fits_either(observation, a, b) {
                let nearer_first = association.prediction_of[o].is_some() || a.seen.z <= b.seen.z;
                best = (gain, Some(if nearer_first { [first, second] } else { [second, first] }));
            }
        }
    }
    best.1
}

fn middle_lies_in(observation: &Observation, appearance: &Appearance) -> bool {
    (0..2).all(|axis| {
        let edges = observation.sides[axis].edges;
        (edges.low..=edges.high).contains(&appearance.seen[axis])
    })
}

/// Log density of the box's free edges under the outline around both.
fn edges_log_density(observation: &Observation, a: &Appearance, b: &Appearance, config: &TrackingConfig) -> f64 {
    let mut sum = 0.0;
    for axis in 0..2 {
        let both = a.outline[axis].union(b.outline[axis]);
        let variance = edge_variance(a, axis, config).max(edge_variance(b, axis, config));
        let side = &observation.sides[axis];
        for (edge, predicted, cut) in
            [(side.edges.low, both.low, side.cut[0]), (side.edges.high, both.high, side.cut[1])]
        {
            if !cut {
                sum -= 0.5 * ((edge - predicted).powi(2) / variance + variance.ln());
            }
        }
    }
    sum
}

fn edge_variance(appearance: &Appearance, axis: usize, config: &TrackingConfig) -> f64 {
    appearance.covariance[(axis, axis)] + config.edge_sigma_px.powi(2)
}

/// A depth between both, one radius more either way, or none.
fn depth_fits_either(observation: &Observation, a: &Appearance, b: &Appearance) -> bool {
    let Some(lift) = &observation.lift else { return true };
    let margin =
        lift.radius_m + 3.0 * (lift.covariance[(2, 2)] + a.covariance[(2, 2)].max(b.covariance[(2, 2)])).sqrt();
    (a.seen.z.min(b.seen.z) - margin..=a.seen.z.max(b.seen.z) + margin).contains(&lift.seen.z)
}
