//! The fruits known so far, and where they are.

use super::birth::Birth;
use super::config::TrackingConfig;
use super::landmark::Landmark;
use super::likelihood::{Residual, Weighed};
use super::merging::{Body, one_fruit_log_odds};
use super::near_view::NearView;
use super::prediction::{Prediction, predict};
use crate::camera::Camera;
use crate::pose::Pose;

/// Nats by which one of two places that a fruit may have beats the other for good.
const DECIDED: f64 = 3.0;

/// An instant: the frame of the tracker, and the way of the camera until then, metres.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Instant {
    pub frame: u64,
    pub way_m: f64,
}

/// Fruits by track number. None is ever removed, so numbers stay.
#[derive(Debug, Clone, Default)]
pub(crate) struct Known {
    pub landmarks: Vec<Landmark>,
    near_view: NearView,
}

impl Known {
    /// How the fruits near the view should look.
    pub fn predictions(&self, camera: &Camera, pose: &Pose, way_m: f64, config: &TrackingConfig) -> Vec<Prediction> {
        let near = self.near_view.of(camera, pose);
        near.into_iter()
            .filter_map(|index| predict(index, &self.landmarks[index], camera, pose, way_m, config))
            .collect()
    }

    /// The number of a new fruit.
    pub fn add(&mut self, born: Birth, pose: &Pose, now: Instant) -> usize {
        let index = self.landmarks.len();
        self.near_view.fruits.insert(index, &born.estimate.centre);
        self.near_view.reach(pose.to_camera(&born.estimate.centre).z);
        self.landmarks.push(Landmark::born(born, now));
        index
    }

    /// Moves a fruit by what its box says, and decides between the places that it may have. The residual at its place,
    /// None where the box decided for the other one.
    pub fn take_up(
        &mut self,
        prediction: &Prediction,
        weighed: &Weighed,
        camera: &Camera,
        pose: &Pose,
    ) -> Option<Residual> {
        let index = prediction.landmark;
        let before = self.landmarks[index].estimate.centre;
        let likely = take_up(&mut self.landmarks[index], prediction, weighed, camera, pose);
        self.near_view.fruits.moved(index, &before, &self.landmarks[index].estimate.centre);
        likely
    }

    /// The record that a record was merged into, in the end.
    pub fn root(&self, mut index: usize) -> usize {
        while let Some(next) = self.landmarks[index].merged_into {
            index = next;
        }
        index
    }

    /// Joins fruits that this frame saw with others in view that are at the same place.
    pub fn merge_in_view(&mut self, predictions: &[Prediction], now: Instant, config: &TrackingConfig) {
        let in_view: Vec<usize> = predictions.iter().map(|prediction| prediction.landmark).collect();
        for (k, &a) in in_view.iter().enumerate() {
            for &b in &in_view[k + 1..] {
                if self.are_one(a, b, now, config) {
                    let other = self.landmarks[b].clone();
                    let before = self.landmarks[a].estimate.centre;
                    self.landmarks[a].absorb(&other);
                    self.near_view.fruits.moved(a, &before, &self.landmarks[a].estimate.centre);
                    self.forget(b, a);
                }
            }
        }
    }

    /// Leaves a record to another one that is the same fruit.
    pub fn forget(&mut self, index: usize, instead: usize) {
        let centre = self.landmarks[index].estimate.centre;
        self.near_view.fruits.remove(index, &centre);
        self.landmarks[index].merged_into = Some(instead);
    }

    fn are_one(&self, a: usize, b: usize, now: Instant, config: &TrackingConfig) -> bool {
        let [first, second] = [&self.landmarks[a], &self.landmarks[b]];
        let is_open = |one: &Landmark| one.merged_into.is_none() && one.doubt.is_none();
        let was_seen = first.last_seen.frame == now.frame || second.last_seen.frame == now.frame;
        let apart = (first.estimate.centre - second.estimate.centre).norm();
        if !was_seen || !is_open(first) || !is_open(second) || apart > 2.0 * (first.radius_m() + second.radius_m()) {
            return false;
        }
        let way_m = (first.last_seen.way_m - second.last_seen.way_m).abs();
        let place_sigma_m = config.drift_m(way_m).hypot(config.pose_sigma_m);
        let together = first.frames_shared_with(second);
        let log_odds = one_fruit_log_odds(&Body::of(first), &Body::of(second), together, place_sigma_m, config);
        log_odds > config.merge_log_odds
    }
}

fn take_up(
    landmark: &mut Landmark,
    prediction: &Prediction,
    weighed: &Weighed,
    camera: &Camera,
    pose: &Pose,
) -> Option<Residual> {
    if let Some(likely) = &weighed.likely {
        landmark.estimate.observe(&prediction.likely, likely, camera, pose);
    }
    let Some(mut doubt) = landmark.doubt.take() else { return weighed.likely };
    let (Some((appearance, _)), Some(other)) = (&prediction.doubt, &weighed.doubt) else { return weighed.likely };
    doubt.estimate.observe(appearance, other, camera, pose);
    doubt.log_odds += weighed.likely.map_or(f64::NEG_INFINITY, |likely| likely.log_density) - other.log_density;
    let is_beaten = doubt.log_odds < 0.0;
    if is_beaten {
        std::mem::swap(&mut landmark.estimate, &mut doubt.estimate);
        doubt.log_odds = -doubt.log_odds;
    }
    landmark.doubt = (doubt.log_odds < DECIDED).then_some(doubt);
    if is_beaten { None } else { weighed.likely }
}
