//! The newest keyframe, which later pictures are compared with.

use super::Lens;
use super::config::OdometryConfig;
use super::eyes::Eyes;
use super::window::{Sighting, Window, triangulated};
use crate::bundle::{KnownPoints, LocateSettings, locate};
use crate::error::Result;
use crate::pose::Pose;
use nalgebra::{Matrix3, Matrix6, Point3, Vector2, Vector3};

/// A pose, and the points of the reference that agree with it.
#[derive(Debug, Clone)]
pub(super) struct Found {
    /// `session_from_camera`.
    pub(super) pose: Pose,
    /// Inverse covariance of its step (translation, rotation).
    pub(super) information: Matrix6<f64>,
    /// Points that agree: their rows in the reference, and where the picture shows them.
    pub(super) agreeing: Vec<(usize, Vector2<f64>)>,
    /// Points that were found at all.
    pub(super) followed: usize,
}

/// The points of a keyframe and what is known of them.
#[derive(Debug, Clone)]
pub(super) struct Reference {
    pub(super) pose: Pose,
    /// Numbers in the part.
    pub(super) numbers: Vec<usize>,
    places_px: Vec<Vector2<f64>>,
    pub(super) positions: Vec<Point3<f64>>,
    covariances: Vec<Matrix3<f64>>,
}

type Matches = Vec<Option<Vector2<f64>>>;

impl Reference {
    /// What the newest keyframe of a window sees.
    pub(super) fn of(window: &Window, pose: Pose) -> Self {
        let seen = window.newest();
        Self {
            pose,
            numbers: seen.iter().map(|(one, _)| one.point).collect(),
            places_px: seen.iter().map(|(one, _)| one.seen.xy()).collect(),
            positions: seen.iter().map(|(_, place)| place.position).collect(),
            covariances: seen.iter().map(|(_, place)| place.covariance).collect(),
        }
    }

    /// Follows the points to a picture, twice if need be, and takes the pose on which they agree.
    pub(super) fn locate<E: Eyes>(
        &self,
        eyes: &mut E,
        expected: &Pose,
        (lens, config): (&Lens, &OdometryConfig),
    ) -> std::result::Result<Option<Found>, E::Error> {
        let mut matches: Matches = vec![None; self.numbers.len()];
        self.follow(eyes, expected, &mut matches, (lens, config))?;
        let Some(found) = self.consensus(&matches, expected, lens, config)? else { return Ok(None) };
        if found.agreeing.len() >= config.enough_inliers {
            return Ok(Some(found));
        }
        matches.fill(None);
        for &(row, place) in &found.agreeing {
            matches[row] = Some(place);
        }
        self.follow(eyes, &found.pose, &mut matches, (lens, config))?;
        Ok(Some(self.consensus(&matches, &found.pose, lens, config)?.unwrap_or(found)))
    }

    /// Looks for the points that are not matched yet and lie in the picture.
    fn follow<E: Eyes>(
        &self,
        eyes: &mut E,
        expected: &Pose,
        matches: &mut Matches,
        (lens, config): (&Lens, &OdometryConfig),
    ) -> std::result::Result<(), E::Error> {
        let (mut rows, mut from_px, mut guesses_px) = (Vec::new(), Vec::new(), Vec::new());
        for row in (0..matches.len()).filter(|&row| matches[row].is_none()) {
            let in_camera = expected.to_camera(&self.positions[row].coords);
            if let Some(guess) = lens.seen(&in_camera, config.nearest_m) {
                rows.push(row);
                from_px.push(self.places_px[row]);
                guesses_px.push(guess);
            }
        }
        let found = eyes.follow(&from_px, &guesses_px)?;
        for (row, place) in rows.into_iter().zip(found) {
            matches[row] = place;
        }
        Ok(())
    }

    fn consensus(
        &self,
        matches: &Matches,
        expected: &Pose,
        lens: &Lens,
        config: &OdometryConfig,
    ) -> Result<Option<Found>> {
        let matched: Vec<(usize, Vector2<f64>)> =
            matches.iter().enumerate().filter_map(|(row, place)| Some((row, (*place)?))).collect();
        let known = KnownPoints {
            points: matched.iter().map(|&(row, _)| self.positions[row]).collect(),
            covariances: matched.iter().map(|&(row, _)| self.covariances[row]).collect(),
            pixels: matched.iter().map(|&(_, place)| place).collect(),
        };
        let settings = LocateSettings { sigma_px: config.sigma_px, ..LocateSettings::default() };
        let Some(located) = locate(&lens.camera, &known, expected, &settings)? else { return Ok(None) };
        let followed = matched.len();
        let agreeing = matched.into_iter().zip(&located.inliers).filter(|(_, agrees)| **agrees).map(|(one, _)| one);
        Ok(Some(Found { pose: located.pose, information: located.information, agreeing: agreeing.collect(), followed }))
    }

    /// The pose of a picture that may show the points anywhere, by patches; slow.
    pub(super) fn found_again<E: Eyes>(
        &self,
        eyes: &mut E,
        expected: &Pose,
        (lens, config): (&Lens, &OdometryConfig),
    ) -> std::result::Result<Option<Pose>, E::Error> {
        let matches = eyes.find_again()?;
        let places: Vec<_> = matches.iter().map(|(seen, _)| triangulated(&lens.camera, seen, config)).collect();
        let known = KnownPoints {
            points: places.iter().map(|place| place.position).collect(),
            covariances: places.iter().map(|place| place.covariance).collect(),
            pixels: matches.iter().map(|&(_, there)| there).collect(),
        };
        let settings = LocateSettings { sigma_px: config.match_sigma_px, ..LocateSettings::default() };
        let located = locate(&lens.camera, &known, &expected.seen_from(&self.pose), &settings)?;
        Ok(located.map(|located| self.pose.after(&located.pose)))
    }

    /// The agreeing points as a later keyframe sees them, with the disparities that are expected there.
    pub(super) fn carried_on(&self, found: &Found, lens: &Lens) -> Vec<(Sighting, f64)> {
        let carried = |&(row, place): &(usize, Vector2<f64>)| {
            let depth_m = found.pose.to_camera(&self.positions[row].coords).z;
            let seen = Vector3::new(place.x, place.y, f64::NAN);
            (Sighting { point: self.numbers[row], seen }, lens.reach_px_m() / depth_m)
        };
        found.agreeing.iter().map(carried).collect()
    }
}
