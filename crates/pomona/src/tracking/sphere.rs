//! Spheres as a camera sees them.

use crate::camera::Camera;
use nalgebra::Vector3;

/// Low and high edge of something along one axis of the picture, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Interval {
    pub low: f64,
    pub high: f64,
}

impl Interval {
    pub fn half(self) -> f64 {
        (self.high - self.low) / 2.0
    }

    pub fn contains(self, other: Self, margin: f64) -> bool {
        other.low >= self.low - margin && other.high <= self.high + margin
    }

    pub fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub fn overlap(self, other: Self) -> f64 {
        (self.high.min(other.high) - self.low.max(other.low)).max(0.0)
    }
}

impl Camera {
    /// Edges of a sphere's box: tangents at theta -+ alpha, tan theta = X / Z, sin alpha = R / sqrt(X^2 + Z^2).
    pub(crate) fn outline(&self, centre: &Vector3<f64>, radius_m: f64) -> [Interval; 2] {
        std::array::from_fn(|axis| {
            let (across, z) = (centre[axis], centre.z);
            let theta = across.atan2(z);
            let alpha = (radius_m / across.hypot(z)).min(1.0).asin();
            let edge = |angle: f64| self.focal_px()[axis] * angle.tan() + self.principal_px()[axis];
            Interval { low: edge(theta - alpha), high: edge(theta + alpha) }
        })
    }

    /// Middle of an interval by angle, where the centre of a sphere with these edges projects to, and its R / Z.
    pub(crate) fn middle_and_ratio(&self, axis: usize, edges: Interval) -> (f64, f64) {
        let angle = |edge: f64| ((edge - self.principal_px()[axis]) / self.focal_px()[axis]).atan();
        let (low, high) = (angle(edges.low), angle(edges.high));
        let middle = f64::midpoint(low, high);
        let ratio = ((high - low) / 2.0).sin() / middle.cos();
        (self.focal_px()[axis] * middle.tan() + self.principal_px()[axis], ratio)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera =
        Camera { width: 640, height: 360, fx: 417.0, fy: 420.0, cx: 320.0, cy: 180.0, baseline_m: None };

    #[test]
    fn a_sphere_and_its_box_give_each_other() {
        let centre = Vector3::new(0.6, -0.3, 1.4);
        let outline = CAMERA.outline(&centre, 0.04);
        let seen = CAMERA.project(&centre);
        for axis in 0..2 {
            let (middle, ratio) = CAMERA.middle_and_ratio(axis, outline[axis]);
            assert!((middle - seen[axis]).abs() < 1e-9);
            assert!((ratio - 0.04 / 1.4).abs() < 1e-12);
        }
    }
}
