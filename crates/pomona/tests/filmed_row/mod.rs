//! A made-up row of fruits, and a camera that drives along it.

use pomona::nalgebra::{Matrix3, Matrix4, Vector3};
use pomona::tracking::{Boxes, LiftedBoxes, Tracker, TrackingConfig};
use pomona::{Camera, Pose};

/// 640 x 360, f = 417 px.
pub const CAMERA: Camera =
    Camera { width: 640, height: 360, fx: 417.0, fy: 417.0, cx: 320.0, cy: 180.0, baseline_m: None };
/// All fruits are alike.
pub const RADIUS_M: f64 = 0.035;
/// Way of the camera between two frames.
pub const STEP_M: f64 = 0.15;

/// A small generator of numbers (xorshift), so that the tests need no crate for it.
pub struct Dice(pub u64);

impl Dice {
    pub fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// One frame: boxes, and which of them have a depth.
#[derive(Default)]
pub struct Seen {
    pub edges_px: Vec<[f64; 4]>,
    pub rows: Vec<usize>,
    pub centres: Vec<Vector3<f64>>,
    pub covariances: Vec<Matrix3<f64>>,
    pub diameters_m: Vec<f64>,
    pub diameter_sigmas_m: Vec<f64>,
}

impl Seen {
    pub fn lifted_box(&mut self, edges_px: [f64; 4], centre: Vector3<f64>, sigma_z_m: f64, radius_m: f64) {
        let ray = centre / centre.z;
        let across = (centre.z / CAMERA.fx).powi(2) / 2.0;
        self.rows.push(self.edges_px.len());
        self.edges_px.push(edges_px);
        self.centres.push(centre);
        self.covariances.push(
            ray * ray.transpose() * sigma_z_m.powi(2) + Matrix3::from_diagonal(&Vector3::new(across, across, 0.0)),
        );
        self.diameters_m.push(2.0 * radius_m);
        self.diameter_sigmas_m.push(0.2 * radius_m);
    }

    pub fn take(&self, tracker: &mut Tracker, frame: i64, pose: &Pose) -> Vec<Option<usize>> {
        self.take_scored(tracker, frame, pose, 1.0)
    }

    pub fn take_scored(&self, tracker: &mut Tracker, frame: i64, pose: &Pose, score: f64) -> Vec<Option<usize>> {
        let scores = vec![score; self.edges_px.len()];
        let lifted = LiftedBoxes {
            rows: &self.rows,
            centres_in_camera: &self.centres,
            covariances: &self.covariances,
            diameters_m: &self.diameters_m,
            diameter_sigmas_m: &self.diameter_sigmas_m,
            support: &vec![0.7; self.rows.len()],
        };
        tracker.update(frame, pose, &Boxes { edges_px: &self.edges_px, scores: &scores }, &lifted).expect("fits")
    }
}

/// Where the camera is after so many steps.
pub fn pose(place: f64) -> Pose {
    let matrix = Matrix4::new_translation(&Vector3::new(place * STEP_M, 0.0, 0.0));
    Pose::from_matrix(&matrix).expect("rigid")
}

/// A tracker with the settings that it has by itself.
pub fn tracker() -> Tracker {
    Tracker::new(CAMERA, TrackingConfig::default()).expect("defaults are valid")
}

/// Edges of a sphere's box, None where the picture does not hold it whole.
pub fn outline(in_camera: &Vector3<f64>) -> Option<[f64; 4]> {
    let edges = |axis: usize| {
        let theta = in_camera[axis].atan2(in_camera.z);
        let alpha = (RADIUS_M / in_camera[axis].hypot(in_camera.z)).asin();
        let edge = |angle: f64| 417.0 * angle.tan() + CAMERA.principal_px()[axis];
        (edge(theta - alpha), edge(theta + alpha))
    };
    let ((xmin, xmax), (ymin, ymax)) = (edges(0), edges(1));
    let inside = xmin > 2.0 && ymin > 2.0 && xmax < 638.0 && ymax < 358.0;
    inside.then_some([xmin, ymin, xmax, ymax])
}

/// Pairs of touching fruits along a row.
pub fn row(dice: &mut Dice, pairs: usize) -> Vec<Vector3<f64>> {
    let mut fruits = Vec::new();
    for pair in 0..pairs {
        let first =
            Vector3::new(-0.5 + 0.1 * pair as f64, 0.35 * (2.0 * dice.uniform() - 1.0), 1.3 + 0.5 * dice.uniform());
        fruits.extend([first, first + Vector3::new(0.05, 0.05, 0.0)]);
    }
    fruits
}

/// What a frame at `place` shows of `fruits`: each with probability `shown`, its depth with a noise of `sigma_z_m`.
pub fn seen(dice: &mut Dice, fruits: &[Vector3<f64>], place: f64, shown: f64, sigma_z_m: f64) -> (Seen, Vec<usize>) {
    let (mut seen, mut names) = (Seen::default(), Vec::new());
    for (name, fruit) in fruits.iter().enumerate() {
        let in_camera = fruit - pose(place).translation;
        let Some(edges_px) = outline(&in_camera) else { continue };
        if dice.uniform() < shown {
            let noisy = in_camera * (1.0 + sigma_z_m * dice.normal() / in_camera.z);
            seen.lifted_box(edges_px.map(|edge| (edge + 0.5 * dice.normal()).round()), noisy, sigma_z_m, RADIUS_M);
            names.push(name);
        }
    }
    (seen, names)
}
