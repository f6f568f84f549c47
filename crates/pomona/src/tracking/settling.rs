//! A frame is looked at a second time, when what it showed is known better.
//!
//! A fruit's first boxes are the hardest: its depth may be wrong, and where one box was taken for another's, a second
//! record starts. Some frames later it is known from many places. Then the boxes of the old frame are assigned once more,
//! to fruits that are well known by now, and with that the frame is settled. What is kept is bounded by the lag.

use super::association::associate;
use super::known::{Instant, Known};
use super::landmark::Landmark;
use super::observation::Observation;
use super::prediction::Prediction;
use super::tracks::Sighting;
use super::unknown::{Conditions, unknown};
use crate::pose::Pose;

/// Frames that must have seen a fruit for it to claim boxes of the past: two make its place, the third confirms it.
const WELL_KNOWN: usize = 3;

/// A frame that is not settled yet.
#[derive(Debug, Clone)]
pub(crate) struct PastFrame {
    pub number: i64,
    pub at: Instant,
    pub pose: Pose,
    pub observations: Vec<Observation>,
    /// Fruit of each box as it was first told, and whether the box is around a second one, too.
    pub told: Vec<Option<(usize, bool)>>,
}

impl PastFrame {
    /// The sightings of this frame for good. Fruits take up boxes that turn out to be theirs.
    pub fn settle(&self, known: &mut Known, conditions: &Conditions<'_>) -> Vec<Sighting> {
        let predictions = self.well_known(known, conditions);
        let unknown: Vec<_> = self.observations.iter().map(|one| unknown(one, conditions)).collect();
        let association = associate(&predictions, &self.observations, &unknown, conditions);
        let shows = |fruit: usize| {
            (0..predictions.len()).any(|p| predictions[p].landmark == fruit && association.box_of[p].is_some())
        };
        let mut sightings = Vec::new();
        for row in 0..self.observations.len() {
            let told = self.told[row].map(|(fruit, shared)| (known.root(fruit), shared));
            let sighting = |fruit, shared| Sighting { frame: self.number, row, fruit, shared };
            match (association.prediction_of[row].map(|p| &predictions[p]), told) {
                (Some(prediction), Some((fruit, shared))) if prediction.landmark == fruit => {
                    sightings.push(sighting(fruit, shared));
                }
                (Some(prediction), told) => {
                    let fruit = prediction.landmark;
                    let p = association.prediction_of[row].unwrap_or_default();
                    known.take_up(prediction, &association.weighed[&(p, row)], conditions.camera, &self.pose);
                    known.landmarks[fruit].views += 1;
                    if let Some((loser, _)) = told {
                        lose(known, loser, fruit);
                    }
                    sightings.push(sighting(fruit, false));
                }
                // A box that no well known fruit explains stays with a fruit that is not, and a shared one as it is.
                (None, Some((fruit, shared)))
                    if !shows(fruit) && (shared || !is_well_known(&known.landmarks[fruit])) =>
                {
                    sightings.push(sighting(fruit, shared));
                }
                (None, Some((fruit, _))) => lose_one(&mut known.landmarks[fruit]),
                (None, None) => {}
            }
        }
        sightings
    }

    fn well_known(&self, known: &Known, conditions: &Conditions<'_>) -> Vec<Prediction> {
        let mut all = known.predictions(conditions.camera, &self.pose, self.at.way_m, conditions.config);
        all.retain(|prediction| is_well_known(&known.landmarks[prediction.landmark]));
        all
    }
}

fn is_well_known(landmark: &Landmark) -> bool {
    landmark.views >= WELL_KNOWN && landmark.doubt.is_none()
}

/// A record that loses its last box was the fruit that got it.
fn lose(known: &mut Known, loser: usize, winner: usize) {
    lose_one(&mut known.landmarks[loser]);
    if known.landmarks[loser].views == 0 {
        known.forget(loser, winner);
    }
}

/// A shared box counts for one fruit only, so views may already be fewer than boxes.
fn lose_one(landmark: &mut Landmark) {
    landmark.views = landmark.views.saturating_sub(1);
}
