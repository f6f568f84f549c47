//! Which fruits are near the view, so that a frame costs what it shows and not what was seen before.

use crate::camera::Camera;
use crate::neighbours::moving::MovingRows;
use crate::pose::Pose;
use nalgebra::Vector3;

/// Edge of a cell, metres: some tens of fruits in a crown.
const CELL_M: f64 = 0.5;

/// Largest distance that is looked at beyond the farthest fruit, over its depth: its place is not known better.
const MARGIN: f64 = 1.2;

/// Fruits by place, and how far they are seen.
#[derive(Debug, Clone)]
pub(crate) struct NearView {
    pub fruits: MovingRows,
    /// Depth of the farthest fruit when it was born, metres.
    reach_m: f64,
}

impl Default for NearView {
    fn default() -> Self {
        Self { fruits: MovingRows::new(CELL_M), reach_m: 0.0 }
    }
}

impl NearView {
    pub fn reach(&mut self, depth_m: f64) {
        self.reach_m = self.reach_m.max(depth_m);
    }

    /// Fruits in cells that touch the box around the camera's pyramid, in ascending order.
    pub fn of(&self, camera: &Camera, pose: &Pose) -> Vec<usize> {
        let depth_m = MARGIN * self.reach_m + CELL_M;
        let [width, height] = camera.size_px();
        let corner = |(x, y)| pose.to_session(&camera.unproject(&Vector3::new(x, y, depth_m)));
        let far = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)].map(corner);
        let mut corners = vec![pose.translation];
        corners.extend(far);
        self.fruits.around(&corners)
    }
}
