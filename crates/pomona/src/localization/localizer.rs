//! The story of one frame after the other.

use super::alignment::{Aligned, Joint, Link, align, evidence_at};
use super::answer::{Localization, MapPair, ToldMotion};
use super::belief::{Belief, Motion};
use super::config::LocalizationConfig;
use super::doubt::Doubt;
use super::known::KnownFruits;
use super::own::own_nats;
use super::residuals::EIGEN_TURNS;
use super::shared::{Sag, covariance};
use super::sightings::{Sighting, cloud_of};
use super::slip::{Slip, lost_by_fit};
use super::told_motions::{Settled, ToldMotions, spread_of_searches};
use super::window::Window;
use crate::answer::Verdict;
use crate::assignment::assign;
use crate::bundle::steps::moved;
use crate::cloud::FruitCloud;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::geometry::Scale;
use crate::matching::{MapIndex, Method, require_directions};
use crate::pose::Pose;
use crate::verified::compact::Bytes;
use nalgebra::{Matrix6, SymmetricEigen, Vector3, Vector6};
use std::collections::BTreeSet;

/// Fruits in the map below which a pose has no redundancy: three fix it.
const MIN_PAIRED: f64 = 4.0;

/// Fruits of the map below which sightings fix no pose: any may be any where all hang within the noise.
const MIN_APART: usize = 3;

/// Fruits of a frame at the most: a search of as many takes a second. Points of a surface in their place would take minutes.
const MOST_SEEN: usize = 5_000;

/// Fruits of a frame whose place is well known that are looked for without the others, at the least.
const FEWEST_SURE: usize = 12;

/// Standard deviations beside a pose that was found, along what is known worst of it, at which it is tried again: beyond what lies on it.
const BESIDE: f64 = 4.0;

/// Standard deviations of a pose that the matcher found: metres, radians.
const MATCHED: (f64, f64) = (0.02, 0.02);

/// A pose that is known no better than this is none, metres: false are those beyond 0.3.
const LOST_M: f64 = 0.1;

/// The same of a direction that motion alone tells, radians: false are those beyond 5 degrees.
const LOST_RAD: f64 = 0.03;

/// A pose that is not told may still be one to look around, as long as fruits are looked for that far, metres.
const KEPT_M: f64 = 0.25;

/// The same of its direction, radians: so far it lays fruits at 2 m.
const KEPT_RAD: f64 = 0.125;

/// Least probability of a reported pair; a wrong pair costs a third of what a right one is worth.
const MIN_PROBABILITY: f64 = 0.25;

/// Evidence that six fitted numbers gain by chance, nats: half of the 99.9 % quantile of chi^2 with 6 degrees.
const FITTED_NATS: f64 = 11.2;

/// False-alarm rate at which the matcher is asked, at the least: each of its answers is looked at once more, with the
/// covariances that it does not use, and has to have [`SEARCHED_NATS`]. Of strangers one frame in so many bears out a pose that those
/// before it are for: the newest one of a pose that several have found together says more for itself.
const SEARCH_RATE: f64 = 0.02;

/// Evidence that the best of a search has by chance, nats: of e^12 = 160,000 poses. Strangers had at most 27 of the 32 that
/// this and the rest make.
const SEARCHED_NATS: f64 = 12.0;

/// Evidence that strangers in the newest frame have for a pose of the frames before, now and then, nats: with 8 to 20 fruits in view after
/// a gap that nobody told it takes half of the wrong poses, and of right ones 2 in 1,000, with twice as much 1 in 100 of 6 to 8 fruits.
const BY_CHANCE_NATS: f64 = 2.0;

/// A map in which a camera finds itself, and where it was last.
#[derive(Debug)]
pub struct Localizer {
    index: MapIndex,
    map: KnownFruits,
    config: LocalizationConfig,
    belief: Option<Belief>,
    doubt: Doubt,
    motions: ToldMotions,
    window: Window,
}

fn require_frame(seen: &FruitCloud) -> Result<()> {
    seen.validate()?;
    if seen.len() <= MOST_SEEN {
        return Ok(());
    }
    let reason = format!("found {} fruits, expected at most {MOST_SEEN} in one frame, each one once", seen.len());
    Err(Error::Request { name: "seen", reason })
}

impl Localizer {
    /// Prepares `map`.
    ///
    /// # Errors
    /// A cloud or a setting that is wrong.
    pub fn new(map: &FruitCloud, config: Config) -> Result<Self> {
        Self::with(map, &config, |of_search| MapIndex::new(map, Method::Verified, Scale::Metric, of_search))
    }

    /// Prepares `map`, whose compact index was kept as `bytes`.
    ///
    /// # Errors
    /// As [`Self::new`], and bytes that are no index of this map.
    pub fn opened(bytes: &Bytes, map: &FruitCloud, config: Config) -> Result<Self> {
        Self::with(map, &config, |of_search| MapIndex::opened(bytes, map, of_search))
    }

    fn with(map: &FruitCloud, config: &Config, index: impl FnOnce(Config) -> Result<MapIndex>) -> Result<Self> {
        config.validate()?;
        let mut of_search = *config;
        of_search.verified.false_alarm_rate = config.verified.false_alarm_rate.max(SEARCH_RATE);
        let index = index(of_search)?;
        let config = config.localization;
        Ok(Self {
            map: KnownFruits::new(map, &index, config.own_m),
            index,
            config,
            belief: None,
            doubt: Doubt::default(),
            motions: ToldMotions::default(),
            window: Window::default(),
        })
    }

    /// Where the camera is, from one frame and nothing else; what [`Self::update`] knows stays as it is.
    ///
    /// `seen` are fruits in the camera's frame; `up` is the vertical in the camera's and in the map's frame: with it fruits
    /// are thought to sink rather than to move aside.
    ///
    /// # Errors
    /// A cloud or a direction that is wrong, more fruits than any frame shows. That the camera is not found is no error.
    pub fn locate(&self, seen: &FruitCloud, up: Option<[Vector3<f64>; 2]>) -> Result<Localization> {
        require_frame(seen)?;
        self.search(&Sighting::of(seen), seen, up)
    }

    /// Where the camera is now, `told` being how it moved since the last call where that is known.
    ///
    /// # Errors
    /// As [`Self::locate`], and a motion or its covariance that is wrong.
    pub fn update(
        &mut self,
        seen: &FruitCloud,
        told: Option<&ToldMotion>,
        up: Option<[Vector3<f64>; 2]>,
    ) -> Result<Localization> {
        require_frame(seen)?;
        require_directions(up)?;
        told.map_or(Ok(()), ToldMotion::validate)?;
        let step = self.motions.next(told, &mut self.window);
        let measured = step.map(|step| Motion::measured(step, told.and_then(|told| told.covariance.as_ref())));
        let motion = measured.or_else(|| self.belief.map(|belief| Motion::repeated(belief.motion)));
        let predicted = self.belief.zip(motion).map(|(belief, motion)| belief.after(&motion));
        match (measured, motion) {
            (Some(motion), _) => self.window.step(&motion),
            // What fruits say of it is settled with the pose.
            (None, Some(motion)) => self.window.step(&Motion::sure(motion.previous_from_camera)),
            (None, None) => self.window.forget(),
        }
        self.window.push(Sighting::of(seen), self.config.window_frames);
        let untold = motion.filter(|_| measured.is_none()).map(|motion| motion.covariance);
        let mut guess = predicted.map(|predicted| self.guess(&predicted, untold.as_ref(), up));
        let agreed = guess.as_mut().and_then(Guess::agreed);
        let found = if let Some((expected, followed)) = agreed {
            self.found_elsewhere(&followed, up)?.unwrap_or_else(|| self.follow(&expected, followed))
        } else {
            if untold.is_some() {
                // Nobody knows where the frames before lie.
                self.window.keep(1);
            }
            self.found_again(guess.as_ref(), up)?
        };
        self.learn(&found, step.as_ref(), guess.as_ref());
        if !found.tracked && (found.pose.is_some() || self.belief.is_none()) {
            // Whatever the camera lost itself by may be what was learned.
            self.motions = ToldMotions::default();
        }
        Ok(found)
    }

    /// Forgets where the camera was: the next update starts from nothing.
    pub fn reset(&mut self) {
        self.belief = None;
        self.doubt = Doubt::default();
        self.motions = ToldMotions::default();
        self.window.forget();
    }

    /// The pose near the predicted one, if the fruits agree with it, and what the newest ones say.
    ///
    /// `untold` is the covariance of the last motion where that was not told.
    fn guess(&self, told: &Belief, untold: Option<&Matrix6<f64>>, up: Option<[Vector3<f64>; 2]>) -> Guess {
        let enough = self.config.enough_fruits;
        let mut settled = match untold {
            None => self.motions.settle(&self.window, enough, &self.map, told),
            Some(expected) => ToldMotions::settle_untold(&self.window, enough, &self.map, told, expected),
        };
        let Some(joint) = self.believed(&settled.aligned, up, 0.0) else {
            let expected = self.motions.ahead(told);
            let frame = self.window.newest();
            let (own_nats, links) = evidence_at(&expected, frame, &self.map);
            let pairs = pairs(&links, frame);
            return Guess { expected, followed: None, pairs, doubt: self.doubt.after(own_nats) };
        };
        let covariance = joint.fixed_view::<6, 6>(0, 0) + settled.spread;
        let found = Belief { pose: settled.aligned.pose, covariance, motion: told.motion };
        // What few fruits leave open, the motion tells.
        let expected = settled.predicted.map_or(found, |predicted| found.joined(&predicted));
        // A motion that nobody told is fitted to the newest frame: what is not known of it counts below.
        let frame = self.window.newest();
        let mut own_nats = match untold {
            Some(_) => settled.aligned.own_nats(),
            None => own_nats(&expected, frame, &self.map, settled.aligned.share),
        };
        if let (Some(_), Some(window)) = (untold, &mut settled.window) {
            window.learn(&joint.fixed_view::<6, 6>(6, 6).into_owned());
            if !self.window.newest().is_empty() {
                own_nats += lost_by_fit(&settled.aligned);
            }
        }
        let by_chance = if frame.is_empty() { 0.0 } else { BY_CHANCE_NATS };
        let doubt = self.doubt.after(own_nats - by_chance);
        Guess { expected, followed: Some(Followed { settled, joint }), pairs: Vec::new(), doubt }
    }

    /// Takes up a pose that the fruits agree with.
    fn follow(&mut self, expected: &Belief, followed: Followed) -> Localization {
        let Followed { settled, joint } = followed;
        self.motions = settled.motions.with(&settled.aligned.slip.known(&joint));
        if let Some(window) = settled.window {
            self.window = window;
        }
        Self::answer(&settled.aligned, &settled.sightings, expected, true)
    }

    /// From nothing, where the newest frame says so much less for its fruits than those before that it could say enough for another pose:
    /// after a motion that was told wrong two or three strangers may bear out a pose for which those before have all the evidence.
    fn found_elsewhere(&mut self, followed: &Followed, up: Option<[Vector3<f64>; 2]>) -> Result<Option<Localization>> {
        let aligned = &followed.settled.aligned;
        let needed = FITTED_NATS + SEARCHED_NATS;
        if aligned.own_nats_short() < needed {
            return Ok(None);
        }
        let frame = self.window.newest();
        let found = self.search(frame, &cloud_of(frame), up)?;
        let more = found.log_odds - aligned.own_nats();
        let elsewhere = found.verdict == Verdict::Found && more > needed;
        if elsewhere {
            self.window.keep(1);
        }
        Ok(elsewhere.then_some(found))
    }

    /// From nothing; else by the motion alone, as long as it is sure and the frame is too poor to contradict it.
    fn found_again(&mut self, guess: Option<&Guess>, up: Option<[Vector3<f64>; 2]>) -> Result<Localization> {
        let found = self.search_anew(up)?;
        let poor = self.window.newest().len() < self.config.enough_fruits && found.verdict != Verdict::Found;
        let carried = guess.filter(|guess| {
            poor && guess.followed.is_none() && guess.doubt.is_none() && guess.is_within(LOST_M, LOST_RAD)
        });
        Ok(carried.map_or(found, |guess| Localization {
            verdict: Verdict::Found,
            pose: Some(guess.expected.pose),
            covariance: guess.expected.covariance,
            pairs: guess.pairs.clone(),
            tracked: true,
            ..Localization::without_pose(Verdict::TooFew)
        }))
    }

    /// The newest frame alone, for the way from those before may be what was wrong; else with these.
    fn search_anew(&mut self, up: Option<[Vector3<f64>; 2]>) -> Result<Localization> {
        let frame = self.window.newest();
        if frame.is_empty() {
            // Those before were looked for when they came.
            return Ok(Localization::without_pose(Verdict::TooFew));
        }
        let found = self.search(frame, &cloud_of(frame), up)?;
        if found.verdict == Verdict::Found {
            self.window.keep(1);
            return Ok(found);
        }
        let fruits = self.window.fruits(self.config.enough_fruits);
        if fruits.len() > frame.len() { self.search(&fruits, &cloud_of(&fruits), up) } else { Ok(found) }
    }

    fn search(&self, sightings: &[Sighting], seen: &FruitCloud, up: Option<[Vector3<f64>; 2]>) -> Result<Localization> {
        let sure: Vec<Sighting> = sightings.iter().filter(|one| one.is_sure()).copied().collect();
        if (FEWEST_SURE..sightings.len()).contains(&sure.len()) {
            let found = self.searched(&sure, &cloud_of(&sure), up)?;
            if let Some(pose) = found.pose {
                let start = Belief { pose, covariance: found.covariance, motion: None };
                // Where the others say less than nothing they have led it astray.
                let of_all = self.settled(sightings, &start, up).filter(|all| all.log_odds > found.log_odds);
                return Ok(of_all.unwrap_or(found));
            }
        }
        self.searched(sightings, seen, up)
    }

    /// The pose that lays the fruits of `seen`, those of the sightings, on the map's.
    fn searched(
        &self,
        sightings: &[Sighting],
        seen: &FruitCloud,
        up: Option<[Vector3<f64>; 2]>,
    ) -> Result<Localization> {
        let found = self.index.search(seen, None, up)?;
        let Some(registration) = found.registration.filter(|_| found.verdict == Verdict::Found) else {
            return Ok(Localization::without_pose(found.verdict));
        };
        let pose = Pose {
            rotation: registration.map_from_query.rotation,
            translation: registration.map_from_query.translation,
        };
        let (place, turn) = MATCHED;
        let covariance = Matrix6::from_diagonal(&Vector6::new(place, place, place, turn, turn, turn).map(|x| x * x));
        let settled = self.settled(sightings, &Belief { pose, covariance, motion: None }, up);
        Ok(settled.unwrap_or_else(|| Localization::without_pose(Verdict::NoMatch)))
    }

    /// The pose near the one that a search has found, if all sightings agree with it.
    fn settled(&self, sightings: &[Sighting], start: &Belief, up: Option<[Vector3<f64>; 2]>) -> Option<Localization> {
        let from = |start: &Belief| {
            let aligned = align(sightings, &self.map, start, &Slip::none());
            let joint =
                self.believed(&aligned, up, SEARCHED_NATS).filter(|_| aligned.own_nats() >= -SEARCH_RATE.ln())?;
            let covariance = joint.fixed_view::<6, 6>(0, 0).into_owned();
            Some((aligned, Belief { covariance, ..*start }))
        };
        let first = from(start)?;
        // A thin row that is turned about its own line lays half of its fruits on others of the map: it may have settled there.
        let found = SymmetricEigen::try_new(first.1.covariance, f64::EPSILON, EIGEN_TURNS)?;
        let loosest = found.eigenvectors.column(found.eigenvalues.imax()) * found.eigenvalues.max().sqrt();
        let beside = |times: f64| Belief { pose: moved(&first.0.pose, &(loosest * times)), ..*start };
        let all: Vec<_> = [-BESIDE, BESIDE].map(beside).iter().filter_map(from).chain([first]).collect();
        let (best, near) = all.iter().max_by(|one, other| one.0.log_odds.total_cmp(&other.0.log_odds))?;
        let spread = spread_of_searches(&best.pose, all.iter().map(|(other, _)| (other.pose, other.log_odds)));
        let belief = Belief { pose: best.pose, covariance: near.covariance + spread, ..*near };
        Some(Self::answer(best, sightings, &belief, false))
    }

    /// Covariance of a pose and its slip, if there is enough for it; `chosen_nats` is what the choice among many gains
    /// by chance.
    fn believed(&self, aligned: &Aligned, up: Option<[Vector3<f64>; 2]>, chosen_nats: f64) -> Option<Joint> {
        let paired: f64 = aligned.says.iter().map(|say| say.voice * say.weight).sum();
        let needed = FITTED_NATS + chosen_nats - self.config.false_alarm_rate.ln();
        let enough = paired >= MIN_PAIRED && told_apart(aligned) >= MIN_APART && aligned.log_odds >= needed;
        let sag = Sag::new(&self.config, up.map(|[_, of_map]| of_map));
        enough.then(|| covariance(aligned, &self.map, &self.window.way(), &sag)).flatten()
    }

    fn answer(aligned: &Aligned, sightings: &[Sighting], belief: &Belief, tracked: bool) -> Localization {
        Localization {
            verdict: if belief.sigma_m() < LOST_M { Verdict::Found } else { Verdict::TooFew },
            pose: Some(belief.pose),
            covariance: belief.covariance,
            pairs: pairs(&aligned.links, sightings),
            log_odds: aligned.log_odds,
            tracked,
        }
        .checked()
    }

    fn learn(&mut self, found: &Localization, previous_from_camera: Option<&Pose>, guess: Option<&Guess>) {
        let before = self.belief.map(|belief| belief.pose);
        (self.belief, self.doubt) = (None, Doubt::default());
        if let Some(pose) = found.pose {
            let motion = previous_from_camera.copied().or_else(|| before.map(|before| pose.seen_from(&before)));
            self.belief = Some(Belief { pose, covariance: found.covariance, motion });
        } else if let Some(guess) = guess {
            if guess.doubt.is_sure(self.config.false_alarm_rate) {
                // What lies before may lie elsewhere.
                self.window.keep(guess.doubt.frames());
            } else if guess.is_within(KEPT_M, KEPT_RAD) {
                (self.belief, self.doubt) = (Some(guess.expected), guess.doubt);
            }
        }
    }
}

/// Where the camera is by what is known from before.
struct Guess {
    /// By motion, and by fruits where they agree.
    expected: Belief,
    followed: Option<Followed>,
    /// Fruits of the newest frame where motion alone tells where it is.
    pairs: Vec<MapPair>,
    /// Whether the newest frame is against it.
    doubt: Doubt,
}

impl Guess {
    /// The pose that all fruits agree with, the newest too.
    fn agreed(&mut self) -> Option<(Belief, Followed)> {
        let followed = self.followed.take_if(|_| self.doubt.is_none() && self.expected.sigma_m() < LOST_M)?;
        Some((self.expected, followed))
    }

    /// Whether place and direction are known as well as this, metres and radians.
    fn is_within(&self, place_m: f64, turn_rad: f64) -> bool {
        self.expected.sigma_m() < place_m && self.expected.sigma_rad() < turn_rad
    }
}

/// A pose that the fruits agree with.
struct Followed {
    settled: Settled,
    /// Covariance of the pose and its slip.
    joint: Joint,
}

/// Fruits of the map that sightings show rather than others.
fn told_apart(aligned: &Aligned) -> usize {
    let shown = aligned.says.iter().filter(|say| say.best_weight >= MIN_PROBABILITY).filter_map(|say| say.best);
    shown.collect::<BTreeSet<_>>().len()
}

/// One to one, of the newest frame.
fn pairs(links: &[Link], sightings: &[Sighting]) -> Vec<MapPair> {
    let own: Vec<&Link> = links
        .iter()
        .filter(|link| sightings[link.sighting].row.is_some() && link.probability >= MIN_PROBABILITY)
        .collect();
    let rows = sightings.iter().filter_map(|one| one.row).max().map_or(0, |row| row + 1);
    let mut columns: Vec<usize> = own.iter().map(|link| link.map).collect();
    columns.sort_unstable();
    columns.dedup();
    let edges: Vec<_> = own
        .iter()
        .filter_map(|link| {
            let column = columns.binary_search(&link.map).ok()?;
            Some((sightings[link.sighting].row?, column, link.probability))
        })
        .collect();
    let gain =
        |row: usize, column: usize| edges.iter().find(|edge| (edge.0, edge.1) == (row, column)).map(|edge| edge.2);
    let chosen = assign(rows, columns.len(), &edges);
    let pair = |(seen, column): (usize, Option<usize>)| {
        let column = column?;
        Some(MapPair { seen, map: columns[column], probability: gain(seen, column)? })
    };
    chosen.into_iter().enumerate().filter_map(pair).collect()
}
