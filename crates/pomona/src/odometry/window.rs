//! The keyframes that are still being adjusted, and the points that they see.

use super::config::OdometryConfig;
use super::way::Way;
use crate::bundle::{Measured, PointView, Problem, Settings, State, adjust};
use crate::camera::Camera;
use crate::error::Result;
use crate::pose::Pose;
use crate::statistics::median;
use nalgebra::{Matrix3, Matrix6, Point3, Vector3};
use std::collections::VecDeque;

/// What is known of a point, in the frame of reference of the part; the covariance is that while the keyframes stay.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) position: Point3<f64>,
    pub(super) covariance: Matrix3<f64>,
}

/// A point in the picture of a keyframe: its number in the part, and u, v, disparity (NaN where it was not measured).
#[derive(Debug, Clone, Copy)]
pub(super) struct Sighting {
    pub(super) point: usize,
    pub(super) seen: Vector3<f64>,
}

#[derive(Debug, Clone)]
struct Keyframe {
    number: usize,
    pose: Pose,
    sightings: Vec<Sighting>,
}

/// Keyframes of one part, the newest adjusted together.
#[derive(Debug, Clone, Default)]
pub(super) struct Window {
    kept: VecDeque<Keyframe>,
    /// Number of the first point that is still known.
    base: usize,
    places: Vec<Place>,
}

impl Window {
    /// Adds a keyframe, whose pose is roughly known, and adjusts: `known` points, and `fresh` ones with a disparity.
    pub(super) fn add(
        &mut self,
        way: &mut Way,
        pose: Pose,
        known: Vec<Sighting>,
        fresh: &[Vector3<f64>],
        (camera, config): (&Camera, &OdometryConfig),
    ) -> Result<()> {
        let first = self.base + self.places.len();
        let mut sightings = known;
        sightings.extend(fresh.iter().zip(first..).map(|(&seen, point)| Sighting { point, seen }));
        let nowhere = Place { position: Point3::origin(), covariance: Matrix3::zeros() };
        self.places.resize(self.places.len() + fresh.len(), nowhere);
        let measured = sightings.iter().map(|one| one.seen.z).filter(|disparity_px| disparity_px.is_finite());
        way.disparities_px.push(median(&mut measured.collect::<Vec<_>>()));
        self.kept.push_back(Keyframe { number: way.keyframes.len(), pose, sightings });
        way.keyframes.push(pose);
        if self.kept.len() > 1 {
            way.information.push(Matrix6::zeros());
            self.adjust(way, camera, config)?;
        }
        self.place_single(camera, config);
        if self.kept.len() > config.free + config.held {
            self.kept.pop_front();
        }
        self.forget();
        Ok(())
    }

    /// What the newest keyframe sees, and what is known of it.
    pub(super) fn newest(&self) -> Vec<(Sighting, Place)> {
        let sightings = self.kept.back().map_or(&[][..], |keyframe| &keyframe.sightings);
        sightings.iter().map(|&one| (one, self.places[one.point - self.base])).collect()
    }

    /// Adjusts the window; observations that then lie outside the gate are thrown away.
    fn adjust(&mut self, way: &mut Way, camera: &Camera, config: &OdometryConfig) -> Result<()> {
        let several = self.seen_by_several();
        let rows = several.iter().scan(0, |next, &is| Some(std::mem::replace(next, *next + usize::from(is))));
        let rows: Vec<usize> = rows.collect();
        let n_free = config.free.min(self.kept.len() - 1);
        let first_free = self.kept.len() - n_free;
        let problem = Problem {
            camera: *camera,
            fixed: (0..self.kept.len()).map(|frame| frame < first_free).collect(),
            observations: self.observations(&several, &rows, config),
            relative_poses: Vec::new(),
        };
        let used = |all: &[Place]| all.iter().zip(&several).filter(|one| *one.1).map(|one| one.0.position).collect();
        let state =
            State { poses: self.kept.iter().map(|keyframe| keyframe.pose).collect(), points: used(&self.places) };
        let found = adjust(&problem, state, &Settings { max_steps: config.max_steps, ..Settings::default() })?;
        for ((place, &row), _) in self.places.iter_mut().zip(&rows).zip(&several).filter(|one| *one.1) {
            *place = Place { position: found.state.points[row], covariance: found.point_covariances[row] };
        }
        for (keyframe, &pose) in self.kept.iter_mut().zip(&found.state.poses) {
            keyframe.pose = pose;
            way.keyframes[keyframe.number] = pose;
        }
        let wanted: Vec<_> = (first_free - 1..self.kept.len() - 1).map(|row| (row, row + 1)).collect();
        for (keyframe, information) in self.kept.range(first_free..).zip(found.relative_information(&wanted)) {
            way.information[keyframe.number - 1] = information.unwrap_or_else(Matrix6::zeros);
        }
        let mut errors = found.squared_errors.into_iter();
        let base = self.base;
        for keyframe in &mut self.kept {
            let is_true = |one: &Sighting| {
                !several[one.point - base] || errors.next().is_some_and(|squared| squared < config.gate)
            };
            keyframe.sightings.retain(is_true);
        }
        Ok(())
    }

    fn seen_by_several(&self) -> Vec<bool> {
        let mut counts = vec![0_usize; self.places.len()];
        for one in self.kept.iter().flat_map(|keyframe| &keyframe.sightings) {
            counts[one.point - self.base] += 1;
        }
        counts.into_iter().map(|count| count > 1).collect()
    }

    fn observations(&self, several: &[bool], rows: &[usize], config: &OdometryConfig) -> Vec<PointView> {
        let mut observations = Vec::new();
        for (pose, keyframe) in self.kept.iter().enumerate() {
            let used = keyframe.sightings.iter().filter(|one| several[one.point - self.base]);
            observations.extend(used.map(|one| observation(pose, rows[one.point - self.base], one.seen, config)));
        }
        observations
    }

    /// Places points that only the newest keyframe has seen, by its stereo alone.
    fn place_single(&mut self, camera: &Camera, config: &OdometryConfig) {
        let Some(newest) = self.kept.back() else { return };
        let mut single = vec![true; self.places.len()];
        for one in self.kept.iter().rev().skip(1).flat_map(|keyframe| &keyframe.sightings) {
            single[one.point - self.base] = false;
        }
        let rotation = newest.pose.rotation.matrix();
        for one in newest.sightings.iter().filter(|one| one.seen.z.is_finite()) {
            let row = one.point - self.base;
            if single[row] {
                let here = triangulated(camera, &one.seen, config);
                let covariance = rotation * here.covariance * rotation.transpose();
                self.places[row] = Place { position: newest.pose.to_session(&here.position.coords).into(), covariance };
            }
        }
    }

    /// Forgets points that no kept keyframe sees.
    fn forget(&mut self) {
        let all = self.kept.iter().flat_map(|keyframe| &keyframe.sightings);
        let oldest = all.map(|one| one.point).min().unwrap_or(self.base);
        self.places.drain(..oldest - self.base);
        self.base = oldest;
    }
}

fn observation(pose: usize, point: usize, seen: Vector3<f64>, config: &OdometryConfig) -> PointView {
    let sharpness = if seen.z.is_finite() { 1.0 / config.sigma_disparity_px } else { 0.0 };
    let whitening = Matrix3::from_diagonal(&Vector3::new(1.0 / config.sigma_px, 1.0 / config.sigma_px, sharpness));
    let disparity_px = if seen.z.is_finite() { seen.z } else { 0.0 };
    PointView { pose, point, measured: Measured::Picture(Vector3::new(seen.x, seen.y, disparity_px)), whitening }
}

/// The place in the camera of u, v, disparity.
pub(super) fn triangulated(camera: &Camera, seen: &Vector3<f64>, config: &OdometryConfig) -> Place {
    let ([fx, fy], z) = (camera.focal_px(), camera.focal_baseline_px_m() / seen.z);
    let position = camera.unproject(&Vector3::new(seen.x, seen.y, z));
    let mut slope = Matrix3::zeros();
    (slope[(0, 0)], slope[(1, 1)]) = (z / fx * config.sigma_px, z / fy * config.sigma_px);
    slope.set_column(2, &(-position * (config.sigma_disparity_px / seen.z)));
    Place { position: position.into(), covariance: slope * slope.transpose() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix;

    /// Points two metres ahead, seen from a camera at `x_m`.
    fn sightings(camera: &Camera, x_m: f64) -> Vec<Sighting> {
        let mut random = SplitMix(9);
        let mut unit = || random.below(1 << 20) as f64 / f64::from(1 << 20) - 0.5;
        let seen = |point| {
            let (x, y, z) = (1.4 * unit() - x_m, unit(), 2.0 + 0.4 * unit());
            let [fx, fy] = camera.focal_px();
            Sighting { point, seen: Vector3::new(fx * x / z, fy * y / z, camera.focal_baseline_px_m() / z) }
        };
        (0..60).map(seen).collect()
    }

    /// How many of sixty points the newest of four keyframes keeps when it sees the first one `off_px` lower.
    fn kept(off_px: f64) -> usize {
        let camera = Camera { fx: 260.0, fy: 260.0, baseline_m: Some(0.1), ..Camera::UNIT };
        let (config, mut window, mut way) = (OdometryConfig::default(), Window::default(), Way::default());
        let first: Vec<_> = sightings(&camera, 0.0).iter().map(|one| one.seen).collect();
        window.add(&mut way, Pose::IDENTITY, Vec::new(), &first, (&camera, &config)).expect("valid");
        for step in 1..=3 {
            let x_m = 0.1 * f64::from(step);
            let mut known = sightings(&camera, x_m);
            known[0].seen.y += if step == 3 { off_px } else { 0.0 };
            window
                .add(
                    &mut way,
                    Pose { translation: Vector3::x() * x_m, ..Pose::IDENTITY },
                    known,
                    &[],
                    (&camera, &config),
                )
                .expect("valid");
        }
        window.newest().len()
    }

    #[test]
    fn what_lies_outside_the_gate_is_thrown_away() {
        // Three keyframes agree, so nine parts of ten of the error are the newest one's: m = 0.9 off_px / 0.5 px < 4.
        assert_eq!(kept(0.0), 60);
        assert_eq!(kept(2.15), 60);
        assert_eq!(kept(2.35), 59);
    }

    #[test]
    fn points_of_one_keyframe_are_as_sure_as_their_stereo() {
        let camera = Camera { fx: 260.0, fy: 260.0, baseline_m: Some(0.1), ..Camera::UNIT };
        let config = OdometryConfig::default();
        let place = triangulated(&camera, &Vector3::new(26.0, 0.0, 13.0), &config);
        assert!((place.position - Point3::new(0.2, 0.0, 2.0)).norm() < 1e-12);
        // Half a pixel of 13 px are 7.7 cm at two metres, half a pixel across are 3.8 mm.
        assert!((place.covariance[(2, 2)].sqrt() - 2.0 * 0.5 / 13.0).abs() < 1e-12);
        assert!((place.covariance[(1, 1)].sqrt() - 2.0 * 0.5 / 260.0).abs() < 1e-12);
    }
}
