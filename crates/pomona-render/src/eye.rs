//! One camera of a pair, as its samples see.

use crate::Vec3;
use crate::noise::{hash, unit};
use crate::raster::View;
use crate::shapes::{Part, Thing};
use pomona::nalgebra::Matrix3;
use pomona::{Camera, Pose};

/// Samples along each side of a pixel: odd, so that the middle one is the pixel's centre.
pub const SAMPLES: usize = 3;

/// What is nearer is not drawn.
const NEAREST_M: f32 = 0.05;

/// A camera at a place, and how far the wind moves the leaves while it looks.
pub struct Eye {
    size: [usize; 2],
    focal: [f32; 2],
    principal: [f32; 2],
    session_from_camera: Matrix3<f32>,
    camera_from_session: Matrix3<f32>,
    place: Vec3,
    /// Directions at the picture's edges, x / z and y / z: low and high.
    slopes: [[f32; 2]; 2],
    gust: Gust,
}

/// How leaves are moved in one frame.
#[derive(Debug, Clone, Copy)]
pub struct Gust {
    /// Standard deviation along each axis, metres.
    pub sigma_m: f32,
    /// Another one moves them elsewhere.
    pub seed: u32,
}

impl Gust {
    /// How far a part is moved: leaves only.
    pub fn on(self, thing: Thing) -> Vec3 {
        let Thing::Leaf(number) = thing else { return Vec3::zeros() };
        if self.sigma_m <= 0.0 {
            return Vec3::zeros();
        }
        // The sum of three numbers from 0 to 1 has mean 3/2 and standard deviation 1/2.
        let normal = |axis: i32| {
            let sum: f32 = (0..3).map(|turn| unit(hash(number as i32, axis, turn, self.seed))).sum();
            2.0 * sum - 3.0
        };
        Vec3::new(normal(0), normal(1), normal(2)) * self.sigma_m
    }
}

impl Eye {
    /// A camera moved to its right by `aside_m`.
    pub fn new(camera: &Camera, session_from_camera: &Pose, aside_m: f64, gust: Gust) -> Self {
        let rotation = session_from_camera.rotation.matrix();
        let place = session_from_camera.translation + rotation.column(0) * aside_m;
        let scale = SAMPLES as f64;
        let slope = |axis: usize, px: f64| ((px - camera.principal_px()[axis]) / camera.focal_px()[axis]) as f32;
        let session_from_camera = rotation.map(|x| x as f32);
        Self {
            size: [camera.width * SAMPLES, camera.height * SAMPLES],
            focal: camera.focal_px().map(|px| (px * scale) as f32),
            principal: camera.principal_px().map(|px| (px * scale) as f32),
            session_from_camera,
            camera_from_session: session_from_camera.transpose(),
            place: place.map(|x| x as f32),
            slopes: [0, 1].map(|axis| [slope(axis, 0.0), slope(axis, camera.size_px()[axis])]),
            gust,
        }
    }

    /// Where the camera is.
    pub fn place(&self) -> Vec3 {
        self.place
    }

    /// Direction of a sample, of length 1 along the optical axis: a multiple of it is the depth.
    pub fn ray(&self, column: usize, row: usize) -> Vec3 {
        let x = (column as f32 + 0.5 - self.principal[0]) / self.focal[0];
        let y = (row as f32 + 0.5 - self.principal[1]) / self.focal[1];
        self.session_from_camera * Vec3::new(x, y, 1.0)
    }

    /// Width of a pixel at a depth, metres.
    pub fn pixel_m(&self, depth_m: f32) -> f32 {
        depth_m * SAMPLES as f32 / self.focal[0]
    }
}

impl View for Eye {
    fn size(&self) -> [usize; 2] {
        self.size
    }

    fn may_show(&self, centre: &Vec3, radius_m: f32) -> bool {
        let seen = self.camera_from_session * (centre - self.place);
        let outside = |axis: usize| {
            let [low, high] = self.slopes[axis];
            seen[axis] - low * seen.z < -radius_m * low.hypot(1.0)
                || seen[axis] - high * seen.z > radius_m * high.hypot(1.0)
        };
        seen.z + radius_m > NEAREST_M && !outside(0) && !outside(1)
    }

    fn project(&self, place: &Vec3) -> Option<Vec3> {
        let seen = self.camera_from_session * (place - self.place);
        (seen.z > NEAREST_M).then(|| {
            let nearness = 1.0 / seen.z;
            let [column, row] = [0, 1].map(|axis| self.focal[axis] * seen[axis] * nearness + self.principal[axis]);
            Vec3::new(column, row, nearness)
        })
    }

    fn moved(&self, part: &Part) -> Vec3 {
        self.gust.on(part.thing)
    }
}
