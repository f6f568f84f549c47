//! One frame after the other: the story of the tracker.

use super::association::{Association, associate};
use super::birth::birth;
use super::camera::{Camera, Pose};
use super::config::TrackingConfig;
use super::landmark::Landmark;
use super::likelihood::Weighed;
use super::merging::{Body, one_fruit_log_odds};
use super::observation::{Boxes, LiftedBoxes, Observation, observations};
use super::population::Population;
use super::prediction::{Prediction, predict};
use super::sharing::{is_second_piece, shared_by};
use super::space::Space;
use super::tracks::{Sighting, Tracks, root, tracks};
use crate::error::{Error, Result};
use nalgebra::Vector3;

/// Nats by which the depth of a fruit's first box must be beaten or confirmed by the second.
const DECIDED: f64 = 3.0;

/// Largest evidence of one frame, nats: boxes of one fruit err alike.
const EVIDENCE_OF_A_FRAME: f64 = 3.0;

/// Follows the fruits of one visit. What is kept grows with the fruits and their sightings; a frame costs what it shows.
#[derive(Debug, Clone)]
pub struct Tracker {
    camera: Camera,
    config: TrackingConfig,
    landmarks: Vec<Landmark>,
    space: Space,
    population: Population,
    sightings: Vec<Sighting>,
    frames: u64,
    last_frame: Option<i64>,
    place: Option<Vector3<f64>>,
    way_m: f64,
}

/// What a box is.
#[derive(Debug, Clone, Copy)]
enum Role {
    /// It shows a known fruit, by prediction.
    Known(usize),
    /// It is around two known fruits; the first counts as seen.
    Shared([usize; 2]),
    /// A second piece of a fruit that another box shows.
    Piece,
    /// None of those.
    New,
}

impl Tracker {
    /// A tracker that knows no fruit yet.
    ///
    /// # Errors
    /// A setting is outside its range.
    pub fn new(camera: Camera, config: TrackingConfig) -> Result<Self> {
        config.validate()?;
        Ok(Self {
            camera,
            config,
            landmarks: Vec::new(),
            space: Space::default(),
            population: Population::default(),
            sightings: Vec::new(),
            frames: 0,
            last_frame: None,
            place: None,
            way_m: 0.0,
        })
    }

    /// The track number of every box of the next frame, None where it shows no fruit that can be placed.
    ///
    /// # Errors
    /// Arrays do not fit together, or the frame's number does not follow the last one's.
    pub fn update(
        &mut self,
        frame: i64,
        session_from_camera: &Pose,
        boxes: &Boxes<'_>,
        lifted: &LiftedBoxes<'_>,
    ) -> Result<Vec<Option<usize>>> {
        let observations = observations(&self.camera, boxes, lifted)?;
        self.arrive(frame, session_from_camera)?;
        let predictions = self.predictions(session_from_camera);
        let association = associate(&predictions, &observations, &self.camera, &self.config);
        let roles = self.roles(&predictions, &observations, &association);
        let numbers: Vec<_> = (0..observations.len())
            .map(|o| match roles[o] {
                Role::Known(p) => Some(self.see(
                    &predictions[p],
                    &observations[o],
                    &association.weighed[&(p, o)],
                    session_from_camera,
                )),
                Role::Shared([p, _]) => Some(self.see_shared(&predictions[p])),
                Role::Piece => None,
                Role::New => self.bear(&observations[o], session_from_camera),
            })
            .collect();
        self.note(frame, &numbers, &roles);
        self.miss(&predictions, &association, &roles);
        self.merge_in_view(&predictions);
        self.frames += 1;
        Ok(numbers.into_iter().map(|number| number.map(|number| root(&self.landmarks, number))).collect())
    }

    /// The fruits seen so far in at least `min_views` frames, duplicates joined.
    pub fn finish(&self, min_views: usize) -> Tracks {
        tracks(&self.landmarks, &self.sightings, min_views, &self.config)
    }

    fn arrive(&mut self, frame: i64, pose: &Pose) -> Result<()> {
        if let Some(last) = self.last_frame.filter(|&last| frame <= last) {
            return Err(Error::FrameOrder { found: frame, last });
        }
        self.last_frame = Some(frame);
        self.way_m += self.place.map_or(0.0, |place| (pose.translation - place).norm());
        self.place = Some(pose.translation);
        Ok(())
    }

    fn predictions(&self, pose: &Pose) -> Vec<Prediction> {
        let near = self.space.near_view(&self.camera, pose);
        near.into_iter()
            .filter_map(|index| predict(index, &self.landmarks[index], &self.camera, pose, self.way_m, &self.config))
            .collect()
    }

    fn roles(&self, predictions: &[Prediction], observations: &[Observation], association: &Association) -> Vec<Role> {
        (0..observations.len())
            .map(|o| {
                let shared = shared_by(o, predictions, observations, association, &self.config);
                match (shared, association.prediction_of[o]) {
                    (Some(both), _) => Role::Shared(both),
                    (None, Some(p)) => Role::Known(p),
                    (None, None) if is_second_piece(o, predictions, observations, association, &self.config) => {
                        Role::Piece
                    }
                    (None, None) => Role::New,
                }
            })
            .collect()
    }

    /// A known fruit takes up what its box shows.
    fn see(&mut self, prediction: &Prediction, observation: &Observation, weighed: &Weighed, pose: &Pose) -> usize {
        let index = prediction.landmark;
        let landmark = &mut self.landmarks[index];
        let before = landmark.estimate.centre;
        landmark.estimate.observe(&prediction.likely, &weighed.likely, &self.camera, pose);
        settle_doubt(landmark, prediction, weighed, &self.camera, pose, &self.config);
        if let Some(lift) = observation.lift.filter(|_| weighed.likely.depth_fits > 0.5) {
            landmark.size.observe(&lift, &self.config);
            self.population.add(&lift);
        }
        landmark.hit(self.frames, self.way_m, weighed.log_odds.min(EVIDENCE_OF_A_FRAME));
        self.space.moved(index, &before, &self.landmarks[index].estimate.centre);
        index
    }

    /// A fruit in a box with another one is there, but the box is not its own.
    fn see_shared(&mut self, prediction: &Prediction) -> usize {
        self.landmarks[prediction.landmark].hit(self.frames, self.way_m, 0.0);
        prediction.landmark
    }

    fn bear(&mut self, observation: &Observation, pose: &Pose) -> Option<usize> {
        let born = birth(observation, &self.population, &self.camera, pose, &self.config)?;
        if let Some(lift) = &observation.lift {
            self.population.add(lift);
        }
        let index = self.landmarks.len();
        self.space.insert(index, &born.estimate.centre);
        self.space.reach(pose.to_camera(&born.estimate.centre).z);
        self.landmarks.push(Landmark::born(
            born.estimate,
            born.doubt,
            born.size,
            born.evidence,
            self.frames,
            self.way_m,
        ));
        Some(index)
    }

    fn note(&mut self, frame: i64, numbers: &[Option<usize>], roles: &[Role]) {
        for (row, (number, role)) in numbers.iter().zip(roles).enumerate() {
            if let Some(fruit) = *number {
                self.sightings.push(Sighting { frame, row, fruit, shared: matches!(role, Role::Shared(_)) });
            }
        }
    }

    /// Fruits that should have shown but did not; not those in a shared box or behind another fruit.
    fn miss(&mut self, predictions: &[Prediction], association: &Association, roles: &[Role]) {
        let in_shared_box = |p: usize| roles.iter().any(|role| matches!(role, Role::Shared(both) if both.contains(&p)));
        for (p, prediction) in predictions.iter().enumerate() {
            let is_missed = association.box_of[p].is_none()
                && self.camera.sees(&prediction.likely.seen, 0.0)
                && !in_shared_box(p)
                && !predictions.iter().any(|other| hides(other, prediction));
            if is_missed {
                self.landmarks[prediction.landmark].evidence += (1.0 - self.config.detection_probability).ln();
            }
        }
    }

    /// Joins fruits that this frame saw with others in view that are at the same place.
    fn merge_in_view(&mut self, predictions: &[Prediction]) {
        let in_view: Vec<usize> = predictions.iter().map(|prediction| prediction.landmark).collect();
        for (k, &a) in in_view.iter().enumerate() {
            for &b in &in_view[k + 1..] {
                if self.are_one(a, b) {
                    self.merge(a, b);
                }
            }
        }
    }

    fn are_one(&self, a: usize, b: usize) -> bool {
        let [first, second] = [&self.landmarks[a], &self.landmarks[b]];
        let is_open = |one: &Landmark| one.merged_into.is_none() && one.doubt.is_none();
        let was_seen = first.last_seen == self.frames || second.last_seen == self.frames;
        let apart = (first.estimate.centre - second.estimate.centre).norm();
        if !was_seen || !is_open(first) || !is_open(second) || apart > 2.0 * (first.radius_m() + second.radius_m()) {
            return false;
        }
        let way_m = (first.last_way_m - second.last_way_m).abs();
        let drift_m = (self.config.drift_per_metre * way_m).min(self.config.max_drift_m);
        let together = first.frames_shared_with(second);
        let [first, second] = [first, second].map(|one| Body {
            centre: one.estimate.centre,
            covariance: one.estimate.covariance,
            radius_m: one.radius_m(),
        });
        let place_sigma_m = drift_m.hypot(self.config.pose_sigma_m);
        one_fruit_log_odds(&first, &second, together, place_sigma_m, &self.config) > self.config.merge_log_odds
    }

    fn merge(&mut self, into: usize, from: usize) {
        let other = self.landmarks[from].clone();
        let before = self.landmarks[into].estimate.centre;
        self.space.remove(from, &other.estimate.centre);
        self.landmarks[from].merged_into = Some(into);
        self.landmarks[into].absorb(&other);
        self.space.moved(into, &before, &self.landmarks[into].estimate.centre);
    }
}

/// The second box of a fruit says whether the first one's depth was the fruit's.
fn settle_doubt(
    landmark: &mut Landmark,
    prediction: &Prediction,
    weighed: &Weighed,
    camera: &Camera,
    pose: &Pose,
    config: &TrackingConfig,
) {
    let Some(mut doubt) = landmark.doubt.take() else { return };
    let (Some(appearance), Some(residual)) = (&prediction.doubt, &weighed.doubt) else { return };
    let wrong = config.depth_outliers;
    let gain = ((1.0 - wrong) / wrong).ln() + weighed.likely.log_density - residual.log_density;
    doubt.observe(appearance, residual, camera, pose);
    if gain < 0.0 {
        landmark.estimate = doubt;
    } else if gain < DECIDED {
        landmark.doubt = Some(doubt);
    }
}

/// Whether one fruit's outline covers the middle of one that is farther.
fn hides(front: &Prediction, back: &Prediction) -> bool {
    front.likely.seen.z < back.likely.seen.z
        && (0..2).all(|axis| {
            let outline = front.likely.outline[axis];
            (outline.low..=outline.high).contains(&back.likely.seen[axis])
        })
}
