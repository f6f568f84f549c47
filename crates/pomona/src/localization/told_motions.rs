//! How far told motions are believed.
//!
//! Odometry that lies steadily lays the frames before beside where they were, and with few fruits in view these outvote
//! the newest. So wherever frames are joined it is asked whether the last motions fall short alike (`slip`), of which
//! the window shows the last eight at the most: what explains the sightings much better than motions as they were told,
//! or as they fell short before, is believed, and followed until it explains them no longer. After eight motions
//! it is taken off what is told, and what is not known of it stays a slip: a motion that is corrected by half a degree too
//! much, frame by frame, turns the camera away where three fruits hardly show it. What is believed less is not forgotten
//! either: how far poses under other slips lie off is in the covariance of the one that is told.

use super::alignment::{Aligned, align};
use super::belief::Belief;
use super::known::KnownFruits;
use super::sightings::Sighting;
use super::slip::{Slip, evidence};
use super::window::Window;
use crate::bundle::steps::{logarithm, moved};
use crate::pose::Pose;
use nalgebra::{Matrix6, Vector6};

/// Motions that a slip is tried for: what began between two of them shows under both.
const TRIED: [usize; 4] = [1, 2, 4, 8];

/// Motions after which a slip is taken off, as many as the window shows.
const SETTLED: usize = 8;

/// Evidence that motions begin to fall short, or end to, before it is believed, nats: once in a thousand frames.
const UNUSUAL_NATS: f64 = 6.9;

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ToldMotions {
    /// By what every motion falls short.
    drift: Vector6<f64>,
    /// By what the last ones do besides.
    slip: Option<Slip>,
    /// Whether the slip is what is not known of the drift.
    drifts: bool,
}

/// A pose, and what it says of the motions.
pub(super) struct Settled {
    pub sightings: Vec<Sighting>,
    pub aligned: Aligned,
    pub motions: ToldMotions,
    /// Covariance of what else might be: the poses under other slips, each as probable as it is.
    pub spread: Matrix6<f64>,
    /// What was expected, unless it is contradicted.
    pub predicted: Option<Belief>,
    /// The frames before, laid anew.
    pub window: Option<Window>,
}

impl ToldMotions {
    /// The next motion, as far as its error is known.
    pub fn next(&mut self, told: Option<&Pose>, window: &mut Window) -> Option<Pose> {
        self.slip = match self.slip {
            Some(slip) if told.is_some() && slip.motions() < SETTLED => Some(slip.later()),
            Some(slip) if told.is_some() => {
                *self = self.taking(&slip, window);
                Some(slip.left())
            }
            _ => None,
        };
        told.map(|told| moved(told, &self.drift))
    }

    /// Where the camera is expected that is at `told` by the motions told.
    pub fn ahead(&self, told: &Belief) -> Belief {
        self.slip.map_or(*told, |slip| slip.ahead(told))
    }

    /// The same with a slip as it was settled, if it was.
    pub fn with(&self, settled: &Slip) -> Self {
        Self { slip: self.slip.map(|before| if settled.motions() > 0 { *settled } else { before }), ..*self }
    }

    /// Settles the pose: motions are as before or right, or where that explains the sightings much better, they have
    /// begun to fall short.
    pub fn settle(&self, window: &Window, enough: usize, map: &KnownFruits, told: &Belief) -> Settled {
        let usual = self.as_before(window, enough, map, told);
        let oldest = oldest(&usual.sightings);
        if oldest == 0 {
            return usual;
        }
        let mut window = window.clone();
        let motions = self.slip.map_or(*self, |slip| self.taking(&slip, &mut window));
        let (sightings, start) = (window.sightings(enough), self.ahead(told));
        let tried = TRIED.iter().filter(|&&since| since <= oldest);
        let mut all: Vec<Aligned> = tried.map(|&since| align(&sightings, map, &start, &Slip::of_last(since))).collect();
        let nats: Vec<f64> = all.iter().map(|one| evidence(one) - UNUSUAL_NATS).collect();
        let usual_nats = evidence(&usual.aligned);
        let best = (0..all.len()).max_by(|&one, &other| nats[one].total_cmp(&nats[other]));
        let best = best.filter(|&best| nats[best] > usual_nats);
        let chosen = best.map_or(usual.aligned.pose, |best| all[best].pose);
        let poses = all.iter().map(|one| one.pose).chain([usual.aligned.pose]);
        let spread = spread(&chosen, poses.zip(nats.iter().copied().chain([usual_nats])));
        let Some(best) = best else { return Settled { spread, ..usual } };
        let aligned = all.swap_remove(best);
        let motions = Self { slip: Some(aligned.slip), ..motions };
        Settled { sightings, aligned, motions, spread, predicted: None, window: Some(window) }
    }

    /// Settles the pose and the last motion, which was not told: the frames before show where the camera was then, the
    /// newest one how far it came. `expected` is the covariance of the motion, which `told` has in its own.
    pub fn settle_untold(
        window: &Window,
        enough: usize,
        map: &KnownFruits,
        told: &Belief,
        expected: &Matrix6<f64>,
    ) -> Settled {
        let sightings = window.sightings(enough);
        let joined = oldest(&sightings) > 0;
        let aligned = if joined {
            let before = Belief { covariance: told.covariance - expected, ..*told };
            align(&sightings, map, &before, &Slip::unknown(expected))
        } else {
            align(&sightings, map, told, &Slip::none())
        };
        let mut window = window.clone();
        window.slip(&aligned.slip);
        Settled {
            sightings,
            aligned,
            motions: Self::default(),
            spread: Matrix6::zeros(),
            predicted: Some(*told),
            window: Some(window),
        }
    }

    /// Settles the pose by motions that are as before or right.
    fn as_before(&self, window: &Window, enough: usize, map: &KnownFruits, told: &Belief) -> Settled {
        let sightings = window.sightings(enough);
        let right = align(&sightings, map, told, &Slip::none());
        let shown = self.slip.filter(|_| oldest(&sightings) > 0);
        let slipped = shown.map(|slip| align(&sightings, map, told, &slip));
        let slipped = slipped.filter(|slipped| self.drifts || evidence(slipped) > evidence(&right));
        let (motions, predicted) = match slipped {
            Some(_) => (*self, self.ahead(told)),
            None if self.drifts => (*self, self.ahead(told)),
            None => (Self { slip: None, ..*self }, *told),
        };
        let aligned = slipped.unwrap_or(right);
        Settled { sightings, aligned, motions, spread: Matrix6::zeros(), predicted: Some(predicted), window: None }
    }

    /// A slip is taken off: frames before are laid by it.
    fn taking(&self, slip: &Slip, window: &mut Window) -> Self {
        window.slip(slip);
        Self { drift: self.drift + slip.of_a_motion(), slip: None, drifts: true }
    }
}

/// How far poses that have so much evidence each, nats, lie from the chosen one.
fn spread(chosen: &Pose, poses: impl Iterator<Item = (Pose, f64)> + Clone) -> Matrix6<f64> {
    let most = poses.clone().fold(f64::NEG_INFINITY, |most, (_, nats)| most.max(nats));
    let (mut sum, mut weights) = (Matrix6::zeros(), 0.0);
    for (pose, nats) in poses {
        let (apart, weight) = (logarithm(&pose.seen_from(chosen)), (nats - most).exp());
        sum += apart * apart.transpose() * weight;
        weights += weight;
    }
    sum / weights
}

/// Motions since the oldest sighting.
fn oldest(sightings: &[Sighting]) -> usize {
    sightings.iter().map(|one| one.age).max().unwrap_or(0)
}
