//! The pose that lays sightings on the map's fruits, nobody said to be who.
//!
//! A sighting p shows the fruit m of the map with a density N(m - T p; S), S the covariances of both and of the pose as it
//! is known so far, or a stranger, of which there are rho in a cubic metre about m, smeared as the sighting is
//! ([`super::strangers`]). With q = N / rho and a share s of sightings in the map, the weights of expectation and
//! maximisation are
//!
//! w = s q / (1 - s + s sum q), and the evidence is the sum of v ln(1 - s + s sum q), v one over how often the sighting's
//! fruit was seen. On wires rho is that of the wire: a wrong pose that lays wires on wires has two numbers of three for nothing.
//!
//! Each turn takes a step of Gauss and Newton under these weights. The pose's own covariance widens S at first and
//! shrinks from turn to turn, so that the first turns see past the nearest fruit.

use super::belief::Belief;
use super::known::{Candidate, KnownFruits};
use super::sightings::Sighting;
use super::slip::Slip;
use crate::bundle::steps::{moved, skew};
use crate::pose::Pose;
use nalgebra::{Matrix3, Matrix3x6, SMatrix, SVector, Vector3};
use std::ops::AddAssign;

/// The step of the pose, then the slip.
pub(super) const UNKNOWNS: usize = 12;

/// Covariance or information of both.
pub(super) type Joint = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// Turns at the most; a good start settles in five.
const TURNS: usize = 20;

/// By how much the doubt of the pose shrinks in a turn: a quarter of its variance is left.
pub(super) const SHRINKING: f64 = 0.25;

/// Turns before which nothing is settled: the doubt is still wider than a fruit.
const WIDE_TURNS: usize = 4;

/// A step below this, metres and radians, changes nothing.
const SETTLED: f64 = 1e-5;

/// Shares of the sightings that are in the map, of which the evidence takes the best.
const SHARES: [f64; 4] = [0.25, 0.5, 0.7, 0.9];

/// The share that the weights begin with.
const FIRST_SHARE: f64 = 0.5;

/// Information of what nothing measures: a step of 100 m or rad.
const LEAST_INFORMATION: f64 = 1e-4;

/// A sighting and a fruit that it may show.
#[derive(Debug, Clone, Copy)]
pub(super) struct Link {
    pub sighting: usize,
    pub map: usize,
    pub probability: f64,
}

/// What one sighting says under a pose.
pub(super) struct Say {
    /// Where it lies in the map.
    pub place: Vector3<f64>,
    /// Sum of its weights.
    pub weight: f64,
    /// As the sighting's.
    pub voice: f64,
    /// As the sighting's.
    pub age: usize,
    /// Sum of weighted inverse covariances.
    pub information: Matrix3<f64>,
    /// Slopes of its place by the step of the pose and by the slip.
    pub slopes: SMatrix<f64, 3, UNKNOWNS>,
    /// The fruit with the largest weight.
    pub best: Option<usize>,
    /// That weight.
    pub best_weight: f64,
    /// Its pull: the sum of weighted inverse covariances times residuals.
    pub pull: Vector3<f64>,
    /// Sum of the weighted squared Mahalanobis distances.
    pub squared: f64,
    /// Covariance of that place.
    own: Matrix3<f64>,
    /// The sum of q.
    ratio: f64,
}

impl Say {
    /// Evidence against chance where a `share` of the sightings is in the map, nats.
    pub fn evidence(&self, share: f64) -> f64 {
        (1.0 - share + share * self.ratio).ln()
    }
}

/// A pose, and what the sightings say of it.
pub(super) struct Aligned {
    pub pose: Pose,
    /// By how much the told motions fall short.
    pub slip: Slip,
    /// Inverse covariance of both if all sightings erred independently.
    pub information: Joint,
    pub says: Vec<Say>,
    pub links: Vec<Link>,
    /// Evidence against chance, nats.
    pub log_odds: f64,
    /// Part of the sightings that are in the map.
    pub share: f64,
}

impl Aligned {
    /// What the fruits of the newest frame say of it, each for itself, nats.
    pub fn own_nats(&self) -> f64 {
        self.nats_of(|age| age == 0).0
    }

    /// How much more as many fruits of the frames before say, nats; none where there are none.
    pub fn own_nats_short(&self) -> f64 {
        let (own, fruits) = self.nats_of(|age| age == 0);
        let (before, as_many) = self.nats_of(|age| age > 0);
        if as_many > 0.0 { before / as_many * fruits - own } else { 0.0 }
    }

    /// What fruits of these ages say, nats, and how many they are.
    fn nats_of(&self, aged: impl Fn(usize) -> bool) -> (f64, f64) {
        let those = self.says.iter().filter(|say| aged(say.age));
        those.fold((0.0, 0.0), |(nats, fruits), say| (nats + say.evidence(self.share), fruits + 1.0))
    }
}

/// Settles a pose that is expected at `told` if the motions have not slipped, and by how much they have.
pub(super) fn align(sightings: &[Sighting], map: &KnownFruits, told: &Belief, slip: &Slip) -> Aligned {
    let (mut pose, mut slip) = (slip.ahead(told).pose, *slip);
    let (mut doubt, mut share) = (slip.doubt(&told.covariance), FIRST_SHARE);
    let laid = laid(sightings, map, &pose, &slip);
    for turn in 0..TURNS {
        let says: Vec<Say> = laid.iter().map(|seen| say(seen, map, &pose, &slip, &doubt, share, None)).collect();
        let (information, pull) = normal(&says, &slip);
        let step = solved(&information, &pull);
        pose = moved(&pose, &step.fixed_rows::<6>(0).into_owned());
        slip.step(&step.fixed_rows::<6>(6).into_owned());
        share = best_share(&says).0;
        doubt *= SHRINKING;
        if turn >= WIDE_TURNS && step.norm() < SETTLED {
            break;
        }
    }
    ended(&laid, map, pose, &slip, share)
}

/// What the sightings say of a pose once it stays.
fn ended(laid: &[Laid], map: &KnownFruits, pose: Pose, slip: &Slip, share: f64) -> Aligned {
    let mut links = Vec::new();
    let sure = Joint::zeros();
    let said = |(row, seen)| say(seen, map, &pose, slip, &sure, share, Some((row, &mut links)));
    let says = whole(laid.iter().enumerate().map(said).collect(), laid, map);
    let (information, _) = normal(&says, slip);
    let (share, log_odds) = best_share(&says);
    Aligned { pose, slip: *slip, information, says, links, log_odds, share }
}

/// What a frame says of a pose that is expected, by its fruits as they lie, nats, and which they may be.
pub(super) fn evidence_at(expected: &Belief, frame: &[Sighting], map: &KnownFruits) -> (f64, Vec<Link>) {
    let (slip, doubt) = (Slip::none(), Slip::none().doubt(&expected.covariance));
    let mut links = Vec::new();
    let laid = laid(frame, map, &expected.pose, &slip);
    let said = |(row, seen)| say(seen, map, &expected.pose, &slip, &doubt, FIRST_SHARE, Some((row, &mut links)));
    let says = whole(laid.iter().enumerate().map(said).collect(), &laid, map);
    (best_share(&says).1, links)
}

/// What sightings say, with all fruits that each may show: a pose goes by those that are near, for what lies farther off than a depth errs
/// is seldom what it is said to be, but nothing speaks against it that is not known so well.
pub(super) fn whole(mut says: Vec<Say>, laid: &[Laid], map: &KnownFruits) -> Vec<Say> {
    says.iter_mut().zip(laid).for_each(|(say, laid)| say.ratio = map.likelihood(&say.place, &say.own) / laid.times);
    says
}

/// A sighting, and how many times as dense for it the strangers about the fruit are that it shows the likeliest ([`super::strangers`]).
pub(super) struct Laid<'a> {
    seen: &'a Sighting,
    times: f64,
}

/// Sightings laid into the map; strangers are as dense wherever the pose settles from there.
pub(super) fn laid<'a>(sightings: &'a [Sighting], map: &KnownFruits, pose: &Pose, slip: &Slip) -> Vec<Laid<'a>> {
    let one = |seen: &'a Sighting| {
        let place = pose.to_session(&slip.corrected(seen));
        Laid { seen, times: map.times(&place, &pose.covariance_to_session(&seen.covariance)) }
    };
    sightings.iter().map(one).collect()
}

pub(super) fn say(
    Laid { seen, times }: &Laid,
    map: &KnownFruits,
    pose: &Pose,
    slip: &Slip,
    doubt: &Joint,
    share: f64,
    links: Option<(usize, &mut Vec<Link>)>,
) -> Say {
    let from_now = slip.corrected(seen);
    let place = pose.to_session(&from_now);
    let rotation = *pose.rotation.matrix();
    let mut by_pose = Matrix3x6::zeros();
    by_pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    by_pose.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-rotation * skew(&from_now)));
    let slopes = slip.slopes(seen, &by_pose);
    let own = pose.covariance_to_session(&seen.covariance) + slopes * doubt * slopes.transpose();
    let near: Vec<Candidate> = map.near(&place).filter_map(|row| map.candidate(row, &place, &own, *times)).collect();
    let ratio: f64 = near.iter().map(|one| one.ratio).sum();
    let whole = 1.0 - share + share * ratio;
    let mut says = Say {
        place,
        weight: 0.0,
        voice: seen.voice,
        age: seen.age,
        information: Matrix3::zeros(),
        slopes,
        best: None,
        best_weight: 0.0,
        pull: Vector3::zeros(),
        squared: 0.0,
        own,
        ratio,
    };
    for one in &near {
        let weight = share * one.ratio / whole;
        says.weight += weight;
        says.information += one.inverse * weight;
        says.pull += one.inverse * one.error * weight;
        says.squared += weight * one.squared;
        if weight > says.best_weight {
            (says.best_weight, says.best) = (weight, Some(one.row));
        }
    }
    if let Some((sighting, links)) = links {
        let link = |one: &Candidate| Link { sighting, map: one.row, probability: share * one.ratio / whole };
        links.extend(near.iter().map(link));
    }
    says
}

fn normal(says: &[Say], slip: &Slip) -> (Joint, SVector<f64, UNKNOWNS>) {
    let (expected, back) = slip.expected();
    let mut matrix = Joint::identity() * LEAST_INFORMATION;
    let mut right = SVector::<f64, UNKNOWNS>::zeros();
    matrix.fixed_view_mut::<6, 6>(6, 6).add_assign(&expected);
    right.fixed_rows_mut::<6>(6).copy_from(&back);
    for say in says {
        let turned = say.slopes.transpose();
        matrix += turned * say.information * say.slopes;
        right += turned * say.pull;
    }
    (matrix, right)
}

fn solved(matrix: &Joint, right: &SVector<f64, UNKNOWNS>) -> SVector<f64, UNKNOWNS> {
    matrix.cholesky().map_or_else(SVector::zeros, |factor| factor.solve(right))
}

/// The share of sightings in the map that explains them best, and the evidence under it, nats.
fn best_share(says: &[Say]) -> (f64, f64) {
    let evidence = |share: f64| says.iter().map(|say| say.voice * say.evidence(share)).sum::<f64>();
    let all = SHARES.map(|share| (share, evidence(share)));
    all.into_iter().fold((FIRST_SHARE, f64::NEG_INFINITY), |best, one| if one.1 > best.1 { one } else { best })
}
