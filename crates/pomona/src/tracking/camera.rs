//! A pinhole camera and where it is; spheres as it sees them.

use crate::error::{Error, Result};
use nalgebra::{Matrix3, Matrix4, Vector3};

/// A rectified pinhole camera; picture coordinates start at the top left corner of the top left pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Focal lengths, pixels: along x, along y.
    pub focal_px: [f64; 2],
    /// Principal point, pixels.
    pub principal_px: [f64; 2],
    /// Width and height of the picture, pixels.
    pub size_px: [f64; 2],
}

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
    /// Column, row and depth of a point in the frame of the camera.
    pub(crate) fn project(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let at = |axis: usize| self.focal_px[axis] * point[axis] / point.z + self.principal_px[axis];
        Vector3::new(at(0), at(1), point.z)
    }

    /// The point at a column, row and depth.
    pub(crate) fn unproject(&self, seen: &Vector3<f64>) -> Vector3<f64> {
        let at = |axis: usize| (seen[axis] - self.principal_px[axis]) / self.focal_px[axis] * seen.z;
        Vector3::new(at(0), at(1), seen.z)
    }

    /// Derivative of [`Self::project`].
    pub(crate) fn projection_jacobian(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let [fx, fy] = self.focal_px;
        let z = point.z;
        Matrix3::new(fx / z, 0.0, -fx * point.x / (z * z), 0.0, fy / z, -fy * point.y / (z * z), 0.0, 0.0, 1.0)
    }

    /// Derivative of [`Self::unproject`].
    pub(crate) fn ray_jacobian(&self, seen: &Vector3<f64>) -> Matrix3<f64> {
        let [fx, fy] = self.focal_px;
        let [cx, cy] = self.principal_px;
        let z = seen.z;
        Matrix3::new(z / fx, 0.0, (seen.x - cx) / fx, 0.0, z / fy, (seen.y - cy) / fy, 0.0, 0.0, 1.0)
    }

    /// Edges of a sphere's box: tangents at theta -+ alpha, tan theta = X / Z, sin alpha = R / sqrt(X^2 + Z^2).
    pub(crate) fn outline(&self, centre: &Vector3<f64>, radius_m: f64) -> [Interval; 2] {
        std::array::from_fn(|axis| {
            let (across, z) = (centre[axis], centre.z);
            let theta = across.atan2(z);
            let alpha = (radius_m / across.hypot(z)).min(1.0).asin();
            let edge = |angle: f64| self.focal_px[axis] * angle.tan() + self.principal_px[axis];
            Interval { low: edge(theta - alpha), high: edge(theta + alpha) }
        })
    }

    /// Middle of an interval by angle, where the centre of a sphere with these edges projects to, and its R / Z.
    pub(crate) fn middle_and_ratio(&self, axis: usize, edges: Interval) -> (f64, f64) {
        let angle = |edge: f64| ((edge - self.principal_px[axis]) / self.focal_px[axis]).atan();
        let (low, high) = (angle(edges.low), angle(edges.high));
        let middle = f64::midpoint(low, high);
        let ratio = ((high - low) / 2.0).sin() / middle.cos();
        (self.focal_px[axis] * middle.tan() + self.principal_px[axis], ratio)
    }

    /// Whether a point in the picture's pyramid lies in front of the camera and within `margin_px` of the picture.
    pub(crate) fn sees(&self, seen: &Vector3<f64>, margin_px: f64) -> bool {
        seen.z > 0.0 && (0..2).all(|axis| seen[axis] > -margin_px && seen[axis] < self.size_px[axis] + margin_px)
    }
}

/// A rigid transform: `session_from_camera`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Turns directions of the camera into the session's.
    pub rotation: Matrix3<f64>,
    /// Place of the camera in the session's frame, metres.
    pub translation: Vector3<f64>,
}

impl Pose {
    /// Nothing moves.
    pub(crate) const IDENTITY: Self = Self {
        rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        translation: Vector3::new(0.0, 0.0, 0.0),
    };

    /// From a 4 x 4 matrix.
    ///
    /// # Errors
    /// Its upper left block is no rotation, or a number is not finite.
    pub fn from_matrix(session_from_camera: &Matrix4<f64>) -> Result<Self> {
        let rotation: Matrix3<f64> = session_from_camera.fixed_view::<3, 3>(0, 0).into();
        let translation: Vector3<f64> = session_from_camera.fixed_view::<3, 1>(0, 3).into();
        let stray = (rotation * rotation.transpose() - Matrix3::identity()).abs().max();
        // Poses written with six digits are orthogonal to 1e-5; a scale of 1 % is no rounding.
        if stray < 1e-3 && rotation.determinant() > 0.0 && translation.iter().all(|x| x.is_finite()) {
            return Ok(Self { rotation: orthogonal(rotation), translation });
        }
        Err(Error::Pose)
    }

    /// This transform after another one: `a_from_b.after(b_from_c)` is `a_from_c`.
    pub(crate) fn after(self, first: &Self) -> Self {
        Self {
            rotation: self.rotation * first.rotation,
            translation: self.rotation * first.translation + self.translation,
        }
    }

    pub(crate) fn inverse(self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    pub(crate) fn to_camera(self, in_session: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.tr_mul(&(in_session - self.translation))
    }

    pub(crate) fn to_session(self, in_camera: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * in_camera + self.translation
    }

    pub(crate) fn covariance_to_camera(self, in_session: &Matrix3<f64>) -> Matrix3<f64> {
        self.rotation.transpose() * in_session * self.rotation
    }

    pub(crate) fn covariance_to_session(self, in_camera: &Matrix3<f64>) -> Matrix3<f64> {
        self.rotation * in_camera * self.rotation.transpose()
    }
}

/// The nearest rotation to one that is nearly a rotation (Newton's steps of the polar decomposition).
fn orthogonal(mut rotation: Matrix3<f64>) -> Matrix3<f64> {
    for _ in 0..3 {
        rotation = rotation * (Matrix3::identity() * 3.0 - rotation.transpose() * rotation) / 2.0;
    }
    rotation
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { focal_px: [417.0, 420.0], principal_px: [320.0, 180.0], size_px: [640.0, 360.0] };

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
        assert!((CAMERA.unproject(&seen) - centre).norm() < 1e-12);
    }

    #[test]
    fn the_two_derivatives_are_inverse() {
        let point = Vector3::new(0.6, -0.3, 1.4);
        let there_and_back = CAMERA.projection_jacobian(&point) * CAMERA.ray_jacobian(&CAMERA.project(&point));
        assert!((there_and_back - Matrix3::identity()).abs().max() < 1e-12);
    }

    #[test]
    fn a_pose_with_a_scale_or_a_mirror_is_refused() {
        assert!(Pose::from_matrix(&Matrix4::identity()).is_ok());
        assert_eq!(Pose::from_matrix(&Matrix4::new_scaling(1.01)), Err(Error::Pose));
        let mut mirror = Matrix4::identity();
        mirror[(0, 0)] = -1.0;
        assert_eq!(Pose::from_matrix(&mirror), Err(Error::Pose));
        mirror[(0, 3)] = f64::NAN;
        assert_eq!(Pose::from_matrix(&mirror), Err(Error::Pose));
    }
}
