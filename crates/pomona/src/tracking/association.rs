//! Which box shows which fruit, such that the summed log-odds are largest.

use super::likelihood::{Weighed, weigh};
use super::observation::Observation;
use super::prediction::Prediction;
use super::unknown::{Conditions, Unknown};
use crate::assignment::assign;
use std::collections::BTreeMap;

/// Boxes against fruits.
pub(crate) struct Association {
    /// Box of each prediction.
    pub box_of: Vec<Option<usize>>,
    /// Prediction of each box.
    pub prediction_of: Vec<Option<usize>>,
    /// Every pair within the gates, by prediction and box.
    pub weighed: BTreeMap<(usize, usize), Weighed>,
}

pub(crate) fn associate(
    predictions: &[Prediction],
    observations: &[Observation],
    unknown: &[Unknown],
    conditions: &Conditions<'_>,
) -> Association {
    let mut weighed = BTreeMap::new();
    for (p, prediction) in predictions.iter().enumerate() {
        for (o, observation) in observations.iter().enumerate() {
            if let Some(found) = weigh(prediction, observation, &unknown[o], conditions) {
                weighed.insert((p, o), found);
            }
        }
    }
    let edges: Vec<_> = weighed.iter().map(|(&(p, o), found)| (p, o, found.log_odds)).collect();
    let box_of = assign(predictions.len(), observations.len(), &edges);
    let mut prediction_of = vec![None; observations.len()];
    for (p, o) in box_of.iter().enumerate() {
        if let Some(o) = *o {
            prediction_of[o] = Some(p);
        }
    }
    Association { box_of, prediction_of, weighed }
}
