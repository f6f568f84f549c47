//! Poses that jump: from one frame to the next no known fruit is where it should be.
//!
//! Odometry that slips lays the camera some decimetres beside. No gate reaches so far, and every fruit would be found anew. So
//! where hardly a known fruit has a box, and hardly a box a known fruit, the constellation of the frame is looked for among the
//! fruits around it.

use super::association::Association;
use super::known::Known;
use super::observation::Observation;
use super::prediction::Prediction;
use crate::answer::Verdict;
use crate::camera::Camera;
use crate::cloud::FruitCloud;
use crate::config::Config;
use crate::geometry::Similarity;
use crate::matching::{Request, match_clouds};
use crate::pose::Pose;
use nalgebra::{Point3, Vector3};

/// Fruits with a depth, and known ones that should show, below which nothing is asked: fewer are no constellation.
const LEAST_FRUITS: usize = 10;

/// Of these, the part that is met where poses are right: nine in ten, and half where a third are hidden.
const MET: f64 = 0.25;

/// The pose by the fruits that are known, where the given one, by which these are predicted, has jumped; `None` where it has
/// not, or they do not say.
pub(super) fn after_jump(
    (predictions, association): (&[Prediction], &Association),
    observations: &[Observation],
    known: &Known,
    camera: &Camera,
) -> Option<Pose> {
    let seen: Vec<Vector3<f64>> =
        observations.iter().filter_map(|one| Some(camera.unproject(&one.lift.as_ref()?.seen))).collect();
    let is_placed = |prediction: &Prediction| known.landmarks[prediction.landmark].is_placed();
    let should_show = |prediction: &Prediction| is_placed(prediction) && camera.sees(&prediction.likely.seen, 0.0);
    let shown: Vec<usize> = (0..predictions.len()).filter(|&p| should_show(&predictions[p])).collect();
    let fewer = shown.len().min(seen.len());
    let met = shown.iter().filter(|&&p| association.box_of[p].is_some()).count();
    if fewer < LEAST_FRUITS || met as f64 > MET * fewer as f64 {
        return None;
    }
    let around = predictions.iter().filter(|one| is_placed(one));
    let places = around.map(|one| known.landmarks[one.landmark].estimate.centre);
    let [query, map] = [cloud_of(seen.into_iter()), cloud_of(places)];
    let found = match_clouds(&query, &map, &Request::default(), &Config::default()).ok()?;
    let registration = found.registration.filter(|_| found.verdict == Verdict::Found)?;
    let Similarity { rotation, translation, .. } = registration.map_from_query;
    Some(Pose { rotation, translation })
}

fn cloud_of(places: impl Iterator<Item = Vector3<f64>>) -> FruitCloud {
    FruitCloud::from_positions(places.map(Point3::from).collect())
}
