//! How far told motions are believed.
//!
//! Odometry that lies steadily lays the frames before beside where they were, and with few fruits in view these outvote
//! the newest. So wherever frames are joined it is asked whether the last motions fall short alike (`slip`), of which
//! the window shows the last eight at the most: what explains the sightings much better than motions as they were told,
//! or as they fell short before, is believed, and followed until it explains them no longer. After eight motions
//! it is taken off what is told, and what is not known of it stays a slip: a motion that is corrected by half a degree too
//! much, frame by frame, turns the camera away where three fruits hardly show it. Motions also err by chance, each by its
//! own: where somebody told how far, and that explains the sightings as well as a slip, nothing is learned for those that
//! come. What nobody told of is thought to be steady, as scales and wheels err. What is believed less is not forgotten either: how far poses under other slips lie off is in the covariance of
//! the one that is told.

use super::alignment::{Aligned, align};
use super::answer::ToldMotion;
use super::belief::Belief;
use super::known::KnownFruits;
use super::sightings::Sighting;
use super::slip::{Slip, evidence};
use super::window::Window;
use crate::bundle::steps::{logarithm, moved};
use crate::pose::Pose;
use crate::verified::first_of_each;
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
    /// Whether somebody told how far they err by chance.
    chance_is_told: bool,
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
    pub fn next(&mut self, told: Option<&ToldMotion>, window: &mut Window) -> Option<Pose> {
        self.chance_is_told = told.is_some_and(|told| told.covariance.is_some());
        self.slip = match self.slip {
            Some(slip) if told.is_some() && slip.motions() < SETTLED => Some(slip.later()),
            Some(slip) if told.is_some() => {
                *self = self.taking(&slip, window);
                Some(slip.left())
            }
            _ => None,
        };
        told.map(|told| moved(&told.previous_from_camera, &self.drift))
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
    /// begun to fall short, or erred by chance.
    pub fn settle(&self, window: &Window, enough: usize, map: &KnownFruits, told: &Belief) -> Settled {
        let usual = self.as_before(window, enough, map, told);
        if oldest(&usual.sightings) == 0 {
            return usual;
        }
        let Begun { mut all, sightings, motions, window } = self.begun(window, enough, map, told);
        let usual_nats = evidence(&usual.aligned);
        let mut poses: Vec<Weighed> = all.iter().map(|one| (one.pose, evidence(one) - UNUSUAL_NATS)).collect();
        let best = (0..all.len()).max_by(|&one, &other| poses[one].1.total_cmp(&poses[other].1));
        let best = best.filter(|&best| poses[best].1 > usual_nats);
        poses.push((usual.aligned.pose, usual_nats));
        let Some(best) = best else { return usual.beside(&poses) };
        if let Some(chance) = self.chance(TRIED[best], &sightings, &window, map, told) {
            let chance_nats = evidence(&chance);
            poses.push((chance.pose, chance_nats));
            if chance_nats > poses[best].1 {
                // A slip that is followed takes up chance, too.
                let settled = if self.slip.is_some() { usual } else { Settled { aligned: chance, ..usual } };
                return settled.beside(&poses);
            }
        }
        let aligned = all.swap_remove(best);
        let motions = Self { slip: Some(aligned.slip), ..motions };
        Settled { sightings, aligned, motions, spread: Matrix6::zeros(), predicted: None, window: Some(window) }
            .beside(&poses)
    }

    /// The last motions erred as far as they were told to, each by its own.
    fn chance(
        &self,
        since: usize,
        sightings: &[Sighting],
        window: &Window,
        map: &KnownFruits,
        told: &Belief,
    ) -> Option<Aligned> {
        let slip = || Slip::by_chance(since, &window.erred(since));
        self.chance_is_told.then(|| align(sightings, map, &self.ahead(told), &slip()))
    }

    /// Tries slips that begin upon what is known.
    fn begun(&self, window: &Window, enough: usize, map: &KnownFruits, told: &Belief) -> Begun {
        let mut window = window.clone();
        let motions = self.slip.map_or(*self, |slip| self.taking(&slip, &mut window));
        let (sightings, start) = (window.sightings(enough), self.ahead(told));
        let tried = TRIED.iter().filter(|&&since| since <= oldest(&sightings));
        let all = tried.map(|&since| align(&sightings, map, &start, &Slip::of_last(since))).collect();
        Begun { all, sightings, motions, window }
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
        let (aligned, spread) = if joined {
            let before = Belief { covariance: told.covariance - expected, ..*told };
            let slip = Slip::by_chance(1, expected);
            // Few fruits may fit others of the map after another motion nearly as well.
            let from = |slip: &Slip| align(&sightings, map, &before, slip);
            let aligned = from(&slip);
            let found = std::iter::once((aligned.pose, evidence(&aligned)));
            let others = slip.others().map(|other| from(&other)).map(|one| (one.pose, evidence(&one)));
            let spread = spread_of_searches(&aligned.pose, found.chain(others));
            (aligned, spread)
        } else {
            (align(&sightings, map, told, &Slip::none()), Matrix6::zeros())
        };
        let mut window = window.clone();
        window.slip(&aligned.slip);
        Settled { sightings, aligned, motions: Self::default(), spread, predicted: Some(*told), window: Some(window) }
    }

    /// Settles the pose by motions that are as before or right.
    fn as_before(&self, window: &Window, enough: usize, map: &KnownFruits, told: &Belief) -> Settled {
        let sightings = window.sightings(enough);
        let right = align(&sightings, map, told, &Slip::none());
        let shown = self.slip.filter(|_| oldest(&sightings) > 0);
        let slipped = shown.map(|slip| align(&sightings, map, told, &slip));
        let slipped = slipped.filter(|slipped| self.drifts || evidence(slipped) > evidence(&right));
        let goes_on = self.drifts || slipped.is_some();
        let (motions, predicted) =
            if goes_on { (*self, self.ahead(told)) } else { (Self { slip: None, ..*self }, *told) };
        let aligned = slipped.unwrap_or(right);
        Settled { sightings, aligned, motions, spread: Matrix6::zeros(), predicted: Some(predicted), window: None }
    }

    /// A slip is taken off: frames before are laid by it.
    fn taking(&self, slip: &Slip, window: &mut Window) -> Self {
        window.slip(slip);
        Self { drift: self.drift + slip.of_a_motion(), slip: None, drifts: true, ..*self }
    }
}

impl Settled {
    /// The same beside other poses that may be.
    fn beside(self, poses: &[Weighed]) -> Self {
        Self { spread: spread(&self.aligned.pose, poses), ..self }
    }
}

/// Slips that begin, one for each of [`TRIED`] that the window shows.
struct Begun {
    all: Vec<Aligned>,
    sightings: Vec<Sighting>,
    /// What is known of motions before them.
    motions: ToldMotions,
    window: Window,
}

/// A pose and its evidence, nats.
type Weighed = (Pose, f64);

/// How far poses lie from the chosen one.
fn spread(chosen: &Pose, poses: &[Weighed]) -> Matrix6<f64> {
    let most = poses.iter().fold(f64::NEG_INFINITY, |most, (_, nats)| most.max(*nats));
    let (mut sum, mut weights) = (Matrix6::zeros(), 0.0);
    for (pose, nats) in poses {
        let (apart, weight) = (logarithm(&pose.seen_from(chosen)), (nats - most).exp());
        sum += apart * apart.transpose() * weight;
        weights += weight;
    }
    sum / weights
}

/// The same of poses of which several searches may have found one.
pub(super) fn spread_of_searches(chosen: &Pose, found: impl Iterator<Item = Weighed>) -> Matrix6<f64> {
    let same = |one: &Weighed, other: &Weighed| logarithm(&one.0.seen_from(&other.0)).norm() < ONE_POSE;
    spread(chosen, &first_of_each(found, usize::MAX, same))
}

/// Two searches that end no farther apart, metres and radians together, have found one pose.
const ONE_POSE: f64 = 1e-3;

/// Motions since the oldest sighting.
fn oldest(sightings: &[Sighting]) -> usize {
    sightings.iter().map(|one| one.age).max().unwrap_or(0)
}
