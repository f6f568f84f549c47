//! One frame after the other: the story of the tracker.

use super::association::{Association, associate};
use super::birth::birth;
use super::camera::{Camera, Pose};
use super::config::TrackingConfig;
use super::known::{Instant, Known};
use super::likelihood::Weighed;
use super::observation::{Boxes, LiftedBoxes, Observation, observations};
use super::population::Population;
use super::prediction::Prediction;
use super::settling::PastFrame;
use super::sharing::{Role, roles};
use super::tracks::{Sighting, Tracks, tracks};
use super::trust::Reliability;
use super::unknown::{Conditions, unknown};
use crate::error::{Error, Result};
use std::collections::VecDeque;

/// Largest evidence of one frame, nats: boxes of one fruit err alike.
const EVIDENCE_OF_A_FRAME: f64 = 3.0;

/// Follows the fruits of one visit. What is kept grows with the fruits and their sightings; a frame costs what it shows.
#[derive(Debug, Clone)]
pub struct Tracker {
    camera: Camera,
    config: TrackingConfig,
    known: Known,
    population: Population,
    reliability: Reliability,
    /// Frames that are not settled, the oldest first.
    past: VecDeque<PastFrame>,
    /// Of settled frames.
    sightings: Vec<Sighting>,
    now: Instant,
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
            known: Known::default(),
            population: Population::default(),
            reliability: Reliability::new(&config),
            past: VecDeque::new(),
            sightings: Vec::new(),
            now: Instant::default(),
        })
    }

    /// The track number of every box of the next frame, None where it shows no fruit that can be placed.
    ///
    /// # Errors
    /// Arrays do not fit together, or the frame's number does not follow the last one's.
    pub fn update(
        &mut self,
        number: i64,
        session_from_camera: &Pose,
        boxes: &Boxes<'_>,
        lifted: &LiftedBoxes<'_>,
    ) -> Result<Vec<Option<usize>>> {
        let observations = observations(&self.camera, boxes, lifted)?;
        self.arrive(number, session_from_camera)?;
        observations.iter().filter_map(|one| one.lift.as_ref()).for_each(|lift| self.population.add(lift));
        let unknown: Vec<_> = observations.iter().map(|one| unknown(one, &self.conditions())).collect();
        let predictions = self.known.predictions(&self.camera, session_from_camera, self.now.way_m, &self.config);
        let association = associate(&predictions, &observations, &unknown, &self.conditions());
        let roles = roles(&predictions, &observations, &association, &self.config);
        let mut told = Vec::new();
        for (o, observation) in observations.iter().enumerate() {
            told.push(match roles[o] {
                Role::Known(p) => {
                    let weighed = &association.weighed[&(p, o)];
                    Some((self.see(&predictions[p], observation, weighed, session_from_camera), false))
                }
                Role::Shared([p, _]) => Some((self.see_shared(&predictions[p]), true)),
                Role::Piece => None,
                Role::New => {
                    let born = birth(observation, &unknown[o], session_from_camera, &self.conditions());
                    born.map(|born| (self.known.add(born, session_from_camera, self.now), false))
                }
            });
        }
        self.miss(&predictions, &association, &roles);
        self.known.merge_in_view(&predictions, self.now, &self.config);
        let numbers = told.iter().map(|told| told.map(|(fruit, _)| self.known.root(fruit))).collect();
        self.past.push_back(PastFrame { number, at: self.now, pose: *session_from_camera, observations, told });
        if self.past.len() > self.config.lag {
            self.settle_oldest();
        }
        Ok(numbers)
    }

    /// The fruits seen so far in at least `min_views` frames, duplicates joined.
    pub fn finish(&self, min_views: usize) -> Tracks {
        let mut settled = self.clone();
        while !settled.past.is_empty() {
            settled.settle_oldest();
        }
        tracks(&settled.known, &settled.sightings, min_views, &self.config)
    }

    fn arrive(&mut self, number: i64, pose: &Pose) -> Result<()> {
        if let Some(last) = self.past.back() {
            if number <= last.number {
                return Err(Error::FrameOrder { found: number, last: last.number });
            }
            self.now.frame += 1;
            self.now.way_m += (pose.translation - last.pose.translation).norm();
        }
        Ok(())
    }

    fn conditions(&self) -> Conditions<'_> {
        Conditions {
            camera: &self.camera,
            config: &self.config,
            size: self.population.size(),
            reliability: &self.reliability,
        }
    }

    /// A known fruit takes up what its box shows.
    fn see(&mut self, prediction: &Prediction, observation: &Observation, weighed: &Weighed, pose: &Pose) -> usize {
        let likely = self.known.take_up(prediction, weighed, &self.camera, pose);
        let landmark = &mut self.known.landmarks[prediction.landmark];
        if let (Some(lift), Some(likely)) = (&observation.lift, likely) {
            if likely.depth_fits > 0.5 {
                landmark.size.observe(lift, &self.config);
            }
            // Two sightings across the ray say where it is, whatever their depths said.
            if landmark.views >= 2 && landmark.doubt.is_none() {
                let is_nearer = lift.seen.z < prediction.likely.seen.z;
                self.reliability.learn(lift.support, likely.depth_fits, is_nearer);
            }
        }
        landmark.hit(self.now, weighed.log_odds.min(EVIDENCE_OF_A_FRAME));
        prediction.landmark
    }

    /// A fruit in a box with another one is there, but the box is not its own.
    fn see_shared(&mut self, prediction: &Prediction) -> usize {
        self.known.landmarks[prediction.landmark].hit(self.now, 0.0);
        prediction.landmark
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
                self.known.landmarks[prediction.landmark].evidence += (1.0 - self.config.detection_probability).ln();
            }
        }
    }

    fn settle_oldest(&mut self) {
        let Some(oldest) = self.past.pop_front() else { return };
        let conditions = Conditions {
            camera: &self.camera,
            config: &self.config,
            size: self.population.size(),
            reliability: &self.reliability,
        };
        self.sightings.extend(oldest.settle(&mut self.known, &conditions));
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
