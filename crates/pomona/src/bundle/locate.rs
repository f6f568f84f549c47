//! The pose of one picture among known points, wrong matches among them.
//!
//! Three matches give a pose by Gauss and Newton's steps from the expected one (as in Geiger, Ziegler and Stiller,
//! `StereoScan`, 2011: no quartic, no four solutions, and the expected pose is always near). The pose on which most
//! matches agree wins; its matches then fix it with the points' own uncertainty in the adjustment.

use super::problem::{Measured, PointView, Problem, State};
use super::steps::{moved, skew};
use super::{Settings, adjust};
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::pose::Pose;
use crate::random::SplitMix;
use nalgebra::{Matrix2, Matrix2x3, Matrix2x6, Matrix3, Matrix6, Point3, Vector2, Vector3, Vector6};

/// Points whose places are known, and where a picture shows them.
#[derive(Debug, Clone)]
pub struct KnownPoints {
    /// Places in the session.
    pub points: Vec<Point3<f64>>,
    /// Their covariances, square metres. A point whose covariance is not positive definite is not used.
    pub covariances: Vec<Matrix3<f64>>,
    /// u, v in the picture, pixels.
    pub pixels: Vec<Vector2<f64>>,
}

/// How to look for a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocateSettings {
    /// Standard deviation of a picture point, pixels.
    pub sigma_px: f64,
    /// Squared Mahalanobis distance up to which a match agrees: 9.21 keeps 99 % of the true ones (chi^2, 2 degrees).
    pub gate: f64,
    /// Wanted probability that one sample of three true matches was drawn.
    pub confidence: f64,
    /// Samples at most: enough for one true match in ten (6,900 at 0.999).
    pub max_samples: usize,
    /// Seed of the samples.
    pub seed: u64,
}

impl Default for LocateSettings {
    fn default() -> Self {
        Self { sigma_px: 0.5, gate: 9.21, confidence: 0.999, max_samples: 7000, seed: 2602 }
    }
}

/// A pose and the matches that agree with it.
#[derive(Debug, Clone)]
pub struct Located {
    /// `session_from_camera`.
    pub pose: Pose,
    /// Inverse covariance of its step (translation, rotation), the points' uncertainty included.
    pub information: Matrix6<f64>,
    /// Which matches agree.
    pub inliers: Vec<bool>,
}

/// Steps from the expected pose with three matches; they settle after four, and what has not settled after ten is wrong.
const STEPS: usize = 10;

/// A step below this, metres and radians, changes no pixel.
const SETTLED: f64 = 1e-6;

/// A pose that needs steps longer than this, metres or radians, has gone astray.
const ASTRAY: f64 = 3.0;

/// Rounds of adjusting to the agreeing matches and looking again which agree.
const ROUNDS: usize = 3;

/// The pose on which the most matches agree, starting from `expected`.
///
/// `None` where fewer than four agree: three always do.
///
/// # Errors
/// Arrays of different lengths, or numbers that are not finite.
pub fn locate(
    camera: &Camera,
    known: &KnownPoints,
    expected: &Pose,
    settings: &LocateSettings,
) -> Result<Option<Located>> {
    let n = known.points.len();
    for (what, found) in [("covariances", known.covariances.len()), ("pixels", known.pixels.len())] {
        if found != n {
            return Err(Error::Length { what, found, expected: n });
        }
    }
    let Some(mut pose) = consensus(camera, known, expected, settings) else { return Ok(None) };
    let mut inliers = agreeing(camera, known, &pose, settings);
    let mut information = Matrix6::zeros();
    for _ in 0..ROUNDS {
        if inliers.iter().filter(|&&agrees| agrees).count() < 4 {
            return Ok(None);
        }
        (pose, information) = refined(camera, known, &pose, &inliers, settings)?;
        let again = agreeing(camera, known, &pose, settings);
        let settled = again == inliers;
        inliers = again;
        if settled {
            break;
        }
    }
    Ok(Some(Located { pose, information, inliers }))
}

/// The best pose of many samples of three; the expected pose itself is the first candidate.
fn consensus(camera: &Camera, known: &KnownPoints, expected: &Pose, settings: &LocateSettings) -> Option<Pose> {
    let n = known.points.len();
    if n < 4 {
        return None;
    }
    let mut random = SplitMix(settings.seed);
    let (mut best_cost, count) = cost(camera, known, expected, settings, f64::INFINITY)?;
    let mut best = *expected;
    let (mut samples, mut needed) = (0, settings.max_samples.min(samples_needed(count as f64 / n as f64, settings)));
    while samples < needed {
        samples += 1;
        let Some(pose) = pose_of_three(camera, known, expected, random.three(n)) else { continue };
        let Some((candidate, count)) = cost(camera, known, &pose, settings, best_cost) else { continue };
        (best, best_cost) = (pose, candidate);
        needed = needed.min(samples_needed(count as f64 / n as f64, settings));
    }
    Some(best)
}

/// Samples that hold three true matches at least once with the wanted confidence, `share` of all being true.
fn samples_needed(share: f64, settings: &LocateSettings) -> usize {
    let all_true = share.powi(3).clamp(1e-12, 1.0 - f64::EPSILON);
    ((1.0 - settings.confidence).ln() / (-all_true).ln_1p()).ceil() as usize
}

/// Predicted u, v of a point, with its slopes by the place in the camera and by the pose.
fn predicted(camera: &Camera, pose: &Pose, point: &Point3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
    let (seen, slope) = camera.project_pair(&pose.to_camera(&point.coords))?;
    Some((seen.fixed_rows::<2>(0).into_owned(), slope.fixed_rows::<2>(0).into_owned()))
}

fn pose_of_three(camera: &Camera, known: &KnownPoints, start: &Pose, sample: [usize; 3]) -> Option<Pose> {
    let mut pose = *start;
    for _ in 0..STEPS {
        let (mut matrix, mut right) = (Matrix6::<f64>::zeros(), Vector6::zeros());
        for i in sample {
            let (seen, slope) = predicted(camera, &pose, &known.points[i])?;
            let place = pose.to_camera(&known.points[i].coords);
            let mut by_pose = Matrix2x6::zeros();
            by_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&-slope);
            by_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(&(slope * skew(&place)));
            matrix += by_pose.tr_mul(&by_pose);
            right += by_pose.tr_mul(&(known.pixels[i] - seen));
        }
        let step = matrix.cholesky()?.solve(&right);
        if step.norm().is_nan() || step.norm() > ASTRAY {
            return None;
        }
        pose = moved(&pose, &step);
        if step.norm() < SETTLED {
            return Some(pose);
        }
    }
    None
}

/// Squared Mahalanobis distance of a match, the point's own uncertainty included.
fn squared_error(camera: &Camera, known: &KnownPoints, pose: &Pose, i: usize, sigma_px: f64) -> f64 {
    let Some((seen, slope)) = predicted(camera, pose, &known.points[i]) else { return f64::INFINITY };
    let turned = slope * pose.rotation.matrix().transpose();
    let covariance = turned * known.covariances[i] * turned.transpose() + Matrix2::identity() * sigma_px.powi(2);
    let error = known.pixels[i] - seen;
    covariance.try_inverse().map_or(f64::INFINITY, |information| error.dot(&(information * error)))
}

/// Truncated squared distances (MSAC) and the number of agreeing matches; none from the bound on, which most poses reach
/// after a part of the matches.
fn cost(
    camera: &Camera,
    known: &KnownPoints,
    pose: &Pose,
    settings: &LocateSettings,
    bound: f64,
) -> Option<(f64, usize)> {
    let (mut cost, mut count) = (0.0, 0);
    for i in 0..known.points.len() {
        let squared = squared_error(camera, known, pose, i, settings.sigma_px);
        cost += squared.min(settings.gate);
        count += usize::from(squared <= settings.gate);
        if cost >= bound {
            return None;
        }
    }
    Some((cost, count))
}

fn agreeing(camera: &Camera, known: &KnownPoints, pose: &Pose, settings: &LocateSettings) -> Vec<bool> {
    let agrees = |i| squared_error(camera, known, pose, i, settings.sigma_px) <= settings.gate;
    (0..known.points.len()).map(|i| agrees(i) && known.covariances[i].cholesky().is_some()).collect()
}

/// L^-1 of C = L L^T; `None` where C is not positive definite: a point that nothing fixes says nothing.
fn whitening(covariance: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    covariance.cholesky()?.l().solve_lower_triangular(&Matrix3::identity())
}

/// Adjusts the pose to the agreeing matches. What is known of a point is a place seen from a pose that stays: the
/// session's origin.
fn refined(
    camera: &Camera,
    known: &KnownPoints,
    pose: &Pose,
    inliers: &[bool],
    settings: &LocateSettings,
) -> Result<(Pose, Matrix6<f64>)> {
    let rows: Vec<usize> = (0..inliers.len()).filter(|&i| inliers[i]).collect();
    let sharpness = 1.0 / settings.sigma_px;
    let mut observations = Vec::with_capacity(2 * rows.len());
    for (point, &i) in rows.iter().enumerate() {
        let Some(whitening) = whitening(&known.covariances[i]) else { continue };
        let place = Measured::Place(known.points[i].coords);
        observations.push(PointView { pose: 0, point, measured: place, whitening });
        let seen = Measured::Picture(Vector3::new(known.pixels[i].x, known.pixels[i].y, 0.0));
        let whitening = Matrix3::from_diagonal(&Vector3::new(sharpness, sharpness, 0.0));
        observations.push(PointView { pose: 1, point, measured: seen, whitening });
    }
    let problem = Problem { camera: *camera, fixed: vec![true, false], observations, relative_poses: Vec::new() };
    let points = rows.iter().map(|&i| known.points[i]).collect();
    let state = State { poses: vec![Pose::IDENTITY, *pose], points };
    let found = adjust(&problem, state, &Settings { max_steps: 10, ..Settings::default() })?;
    let information = found.relative_information(&[(0, 1)])[0].unwrap_or_else(Matrix6::zeros);
    Ok((found.state.poses[1], information))
}
