//! One frame after the other: the story of the tracker.

use super::alignment::aligned;
use super::association::{Association, associate};
use super::birth::birth;
use super::config::TrackingConfig;
use super::glimpse::{Expected, Glimpses, OwnedPicture};
use super::jump::after_jump;
use super::known::{Instant, Known};
use super::likelihood::Weighed;
use super::observation::{Boxes, LiftedBoxes, Observation, observations};
use super::population::Population;
use super::prediction::Prediction;
use super::settling::PastFrame;
use super::sharing::{Role, roles};
use super::tracks::{Sighting, Tracks, tracks};
use super::trust::Reliability;
use super::unknown::{Conditions, Unknown, unknown};
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::pose::Pose;
use crate::stereo::Picture;
use nalgebra::Vector3;
use std::collections::{BTreeMap, VecDeque};

/// Largest evidence of one frame, nats: boxes of one fruit err alike.
const EVIDENCE_OF_A_FRAME: f64 = 3.0;

/// Frames after which a picture is looked at for fruits without a box: most are known by then. At 1280 x 720 that many
/// pictures are 22 MB.
const GLIMPSE_LAG: usize = 8;

/// Times that a pose is corrected: the second time boxes are assigned that the first one brought into the gates.
const ALIGNMENTS: usize = 3;

/// Follows the fruits of one visit. What is kept grows with the fruits and their sightings; a frame costs what it shows.
#[derive(Debug, Clone)]
pub struct Tracker {
    camera: Camera,
    config: TrackingConfig,
    /// With the noise that poses have before fruits correct them.
    unaligned: TrackingConfig,
    known: Known,
    population: Population,
    reliability: Reliability,
    /// Frames that are not settled, the oldest first.
    past: VecDeque<PastFrame>,
    /// Of settled frames.
    sightings: Vec<Sighting>,
    now: Instant,
    /// Number of the last frame, and the place that was given for it.
    last: Option<(i64, Vector3<f64>)>,
    /// Pictures of the newest frames, the oldest first.
    pictures: VecDeque<OwnedPicture>,
    glimpses: Glimpses,
    /// What known fruits say that poses are wrong by: corrected pose = `correction` after the given one.
    correction: Pose,
}

/// A frame against the known fruits.
struct View {
    pose: Pose,
    predictions: Vec<Prediction>,
    association: Association,
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
            config: config.with_aligned_poses(),
            unaligned: config,
            known: Known::default(),
            population: Population::default(),
            reliability: Reliability::new(&config),
            past: VecDeque::new(),
            sightings: Vec::new(),
            now: Instant::default(),
            last: None,
            pictures: VecDeque::new(),
            glimpses: Glimpses::default(),
            correction: Pose::IDENTITY,
        })
    }

    /// The track number of every box of the next frame, None where it shows no fruit that can be placed.
    ///
    /// # Errors
    /// Arrays do not fit together, the pose is none, or the frame's number does not follow the last one's.
    pub fn update(
        &mut self,
        number: i64,
        session_from_camera: &Pose,
        boxes: &Boxes<'_>,
        lifted: &LiftedBoxes<'_>,
    ) -> Result<Vec<Option<usize>>> {
        session_from_camera.validate()?;
        let observations = observations(&self.camera, boxes, lifted)?;
        self.arrive(number, session_from_camera)?;
        observations.iter().filter_map(|one| one.lift.as_ref()).for_each(|lift| self.population.add(lift));
        let unknown: Vec<_> = observations.iter().map(|one| unknown(one, &self.conditions())).collect();
        let view = self.look(session_from_camera, &observations, &unknown);
        let roles = roles(&view.predictions, &observations, &view.association, &self.config);
        let told = self.tell(&view, &roles, &observations, &unknown);
        self.miss(&view, &roles);
        self.known.merge_in_view(&view.predictions, self.now, &self.config);
        let numbers = told.iter().map(|told| told.map(|(fruit, _)| self.known.root(fruit))).collect();
        self.past.push_back(PastFrame { number, at: self.now, pose: view.pose, observations, told });
        if self.past.len() > self.config.lag {
            self.settle_oldest();
        }
        Ok(numbers)
    }

    /// Takes the picture of the last frame, to look in it for the fruits that have no box there.
    pub fn glimpse(&mut self, picture: Picture) {
        let Some((number, _)) = self.last else { return };
        self.pictures.push_back(OwnedPicture::new(number, picture));
        if self.pictures.len() > GLIMPSE_LAG.min(self.config.lag) {
            self.look_at_oldest();
        }
    }

    /// Some frames later it is known which fruits the frame should show, those among them that were found after it.
    fn look_at_oldest(&mut self) {
        let Some(picture) = self.pictures.pop_front() else { return };
        let Some(frame) = self.past.iter().find(|frame| frame.number == picture.frame) else { return };
        let predictions = self.known.predictions(&self.camera, &frame.pose, frame.at.way_m, &self.config);
        let row_of: BTreeMap<usize, usize> = (frame.told.iter().enumerate())
            .filter_map(|(row, told)| told.map(|(fruit, _)| (self.known.root(fruit), row)))
            .collect();
        let expected: Vec<Expected> = predictions
            .iter()
            .filter(|prediction| !predictions.iter().any(|other| hides(other, prediction)))
            .filter_map(|one| Expected::new(one.landmark, &one.likely, row_of.get(&one.landmark).copied()))
            .collect();
        for landmark in self.glimpses.seen(picture.picture(), &frame.observations, &expected) {
            self.known.landmarks[landmark].glimpses.push(frame.number);
        }
    }

    /// The fruits seen so far in at least `min_views` frames, duplicates joined.
    pub fn finish(&self, min_views: usize) -> Tracks {
        let mut settled = self.clone();
        while !settled.pictures.is_empty() {
            settled.look_at_oldest();
        }
        while !settled.past.is_empty() {
            settled.settle_oldest();
        }
        if !settled.glimpses.are_many_missed() {
            settled.known.landmarks.iter_mut().for_each(|one| one.glimpses.clear());
        }
        let found = tracks(&settled.known, &settled.sightings, min_views, &self.config);
        Tracks { missed_boxes: settled.glimpses.missed_boxes(), ..found }
    }

    fn arrive(&mut self, number: i64, pose: &Pose) -> Result<()> {
        if let Some((last, place)) = self.last {
            if number <= last {
                return Err(Error::FrameOrder { found: number, last });
            }
            self.now.frame += 1;
            self.now.way_m += (pose.translation - place).norm();
        }
        self.last = Some((number, pose.translation));
        Ok(())
    }

    /// Assigns boxes to known fruits, from where these say that the camera is.
    fn look(&mut self, given: &Pose, observations: &[Observation], unknown: &[Unknown]) -> View {
        let mut pose = self.correction.after(given);
        let mut view = self.view(pose, &self.unaligned, observations, unknown);
        let fruits = (view.predictions.as_slice(), &view.association);
        if let Some(there) = after_jump(fruits, observations, &self.known, &self.camera) {
            view = self.corrected(given, there, observations, unknown);
            pose = there;
        }
        for _ in 0..ALIGNMENTS {
            let fruits = (view.predictions.as_slice(), &view.association, &self.known);
            let Some(better) = aligned(&pose, fruits, &self.camera, &self.unaligned) else { return view };
            if better == pose {
                break;
            }
            view = self.corrected(given, better, observations, unknown);
            pose = better;
        }
        self.view(pose, &self.config, observations, unknown)
    }

    /// Learns where the camera is in place of the given pose, and looks from there.
    fn corrected(&mut self, given: &Pose, pose: Pose, observations: &[Observation], unknown: &[Unknown]) -> View {
        self.correction = pose.after(&given.inverse());
        self.view(pose, &self.unaligned, observations, unknown)
    }

    fn view(&self, pose: Pose, config: &TrackingConfig, observations: &[Observation], unknown: &[Unknown]) -> View {
        let predictions = self.known.predictions(&self.camera, &pose, self.now.way_m, config);
        let association = associate(&predictions, observations, unknown, &self.conditions());
        View { pose, predictions, association }
    }

    /// Takes up each box as what it is. The fruit of each box, and whether it has the box with another one.
    fn tell(
        &mut self,
        view: &View,
        roles: &[Role],
        observations: &[Observation],
        unknown: &[Unknown],
    ) -> Vec<Option<(usize, bool)>> {
        let tell = |(o, observation): (usize, &Observation)| match roles[o] {
            Role::Known(p) => {
                let weighed = &view.association.weighed[&(p, o)];
                Some((self.see(&view.predictions[p], observation, weighed, &view.pose), false))
            }
            Role::Shared([p, _]) => Some((self.see_shared(&view.predictions[p]), true)),
            Role::Piece => None,
            Role::New => {
                let born = birth(observation, &unknown[o], &view.pose, &self.conditions())?;
                Some((self.known.add(born, &view.pose, self.now), false))
            }
        };
        observations.iter().enumerate().map(tell).collect()
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
            if landmark.is_placed() {
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
    fn miss(&mut self, view: &View, roles: &[Role]) {
        let View { predictions, association, .. } = view;
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
