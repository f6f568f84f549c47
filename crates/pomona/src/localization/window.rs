//! The last frames, seen from where the camera is now.

use super::belief::Motion;
use super::sightings::Sighting;
use super::slip::Slip;
use crate::bundle::steps::carried;
use crate::pose::Pose;
use nalgebra::Matrix6;
use std::collections::VecDeque;

/// How surely the way between two frames is known, metres: it adds up over the frames.
const WAY_SIGMA_M: f64 = 0.004;

/// Sightings from which on more say little more to the search: a frame of 40 fruits is found as a rule, and half are hidden.
const ENOUGH_TO_SEARCH: usize = 60;

/// Distance within which two sightings are thought to be of one fruit, metres: about a fruit.
const ONE_FRUIT_M: f64 = 0.05;

#[derive(Debug, Default, Clone)]
pub(super) struct Window {
    /// Newest first, each from its own camera, with `now_from_then`.
    frames: VecDeque<(Pose, Vec<Sighting>)>,
    /// Covariance of the motion after each but the newest, as a step of the camera as it is now.
    motions: VecDeque<Matrix6<f64>>,
}

impl Window {
    /// The camera has moved: what was seen lies elsewhere from it.
    pub fn step(&mut self, motion: &Motion) {
        let turned = carried(&motion.previous_from_camera);
        for covariance in &mut self.motions {
            *covariance = turned * *covariance * turned.transpose();
        }
        self.motions.push_front(motion.covariance);
        let now_from_previous = motion.previous_from_camera.inverse();
        for (now_from_then, _) in &mut self.frames {
            *now_from_then = now_from_previous.after(now_from_then);
        }
    }

    /// Fruits have shown how the camera moved last, as surely as this.
    pub fn learn(&mut self, covariance: &Matrix6<f64>) {
        if let Some(last) = self.motions.front_mut() {
            *last = *covariance;
        }
    }

    /// The told motions have slipped.
    pub fn slip(&mut self, slip: &Slip) {
        for (age, (now_from_then, _)) in self.frames.iter_mut().enumerate().skip(1) {
            *now_from_then = slip.since(age).after(now_from_then);
        }
    }

    /// Takes a frame up, and forgets the oldest beyond `most`.
    pub fn push(&mut self, sightings: Vec<Sighting>, most: usize) {
        self.frames.push_front((Pose::IDENTITY, sightings));
        self.keep(most);
    }

    /// Keeps the newest frames only.
    pub fn keep(&mut self, frames: usize) {
        self.frames.truncate(frames);
        self.motions.truncate(frames.saturating_sub(1));
    }

    pub fn forget(&mut self) {
        self.frames.clear();
        self.motions.clear();
    }

    /// Covariance of each motion, the last one first.
    pub fn way(&self) -> Vec<Matrix6<f64>> {
        self.motions.iter().copied().collect()
    }

    /// Covariance of the last motions together.
    pub fn erred(&self, motions: usize) -> Matrix6<f64> {
        self.motions.iter().take(motions).sum()
    }

    /// Sightings of the newest frame.
    pub fn newest(&self) -> &[Sighting] {
        self.frames.front().map_or(&[], |(_, seen)| seen)
    }

    /// Sightings of the newest frame, and of those before until there are enough.
    pub fn sightings(&self, enough: usize) -> Vec<Sighting> {
        let mut all = Vec::new();
        for (age, (now_from_then, seen)) in self.frames.iter().enumerate() {
            if age == 0 {
                all.extend_from_slice(seen);
            } else if all.len() < enough {
                let spread_m = WAY_SIGMA_M * age as f64;
                all.extend(seen.iter().map(|one| one.carried(now_from_then, age, spread_m)));
            }
        }
        with_voices(all)
    }

    /// Each fruit once, as far as places tell: a cloud to be matched. A frame that stands alone is not mixed with those
    /// before: the way from them may be what is wrong.
    pub fn fruits(&self, enough: usize) -> Vec<Sighting> {
        let wanted = if self.newest().len() < enough { ENOUGH_TO_SEARCH } else { enough };
        let mut fruits: Vec<Sighting> = Vec::new();
        for one in self.sightings(wanted) {
            let known = |other: &Sighting| (other.place - one.place).norm() < ONE_FRUIT_M;
            if one.row.is_some() || !fruits.iter().any(known) {
                fruits.push(one);
            }
        }
        fruits
    }
}

/// Two sightings of the newest frame are two fruits; of the others nobody knows which frame they are from.
fn with_voices(mut all: Vec<Sighting>) -> Vec<Sighting> {
    let is_one_fruit = |one: &Sighting, other: &Sighting| {
        (one.row.is_none() || other.row.is_none()) && (other.place - one.place).norm() < ONE_FRUIT_M
    };
    let seen = |row: usize| {
        let again = |&other: &usize| other != row && is_one_fruit(&all[row], &all[other]);
        1 + (0..all.len()).filter(again).count()
    };
    let voices: Vec<f64> = (0..all.len()).map(|row| 1.0 / seen(row) as f64).collect();
    for (one, voice) in all.iter_mut().zip(voices) {
        one.voice = voice;
    }
    all
}
