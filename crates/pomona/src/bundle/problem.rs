//! What was measured, and how far a state of poses and points is from it.

use super::pose::{Pose, carried, inverse_right_jacobian, logarithm, skew};
use nalgebra::{Matrix3, Matrix3x6, Matrix6, Point3, Vector3, Vector6};

/// A rectified stereo camera. A point (x, y, z) of the left camera is seen at u = fx x / z + cx, v = fy y / z + cy, with
/// the disparity d = fx baseline / z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoCamera {
    /// Focal lengths, pixels.
    pub focal_px: [f64; 2],
    /// Principal point, pixels.
    pub centre_px: [f64; 2],
    /// Distance of the right camera, metres.
    pub baseline_m: f64,
}

impl StereoCamera {
    /// (u, v, d) of a point in front of the camera, with its derivative.
    #[inline]
    pub(super) fn project(&self, point: &Vector3<f64>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        if point.z <= NEAREST_M {
            return None;
        }
        let ([fx, fy], inverse) = (self.focal_px, 1.0 / point.z);
        let (x, y) = (point.x * inverse, point.y * inverse);
        let reach = fx * self.baseline_m;
        let seen = Vector3::new(fx * x + self.centre_px[0], fy * y + self.centre_px[1], reach * inverse);
        let slope = Matrix3::new(fx, 0.0, -fx * x, 0.0, fy, -fy * y, 0.0, 0.0, -reach * inverse) * inverse;
        Some((seen, slope))
    }
}

/// Nearer than a centimetre nothing is in focus, and the projection has no use.
const NEAREST_M: f64 = 0.01;

/// What one camera says of one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Measured {
    /// u, v and disparity, pixels. A disparity that was not measured has a row of zeros in the whitening.
    Picture(Vector3<f64>),
    /// The place in the camera's frame, metres.
    Place(Vector3<f64>),
}

/// One camera sees one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Row of the pose.
    pub pose: usize,
    /// Row of the point.
    pub point: usize,
    /// What was measured.
    pub measured: Measured,
    /// W, where W^T W is the inverse of the measurement's covariance.
    pub whitening: Matrix3<f64>,
}

/// The pose of one camera in another, measured by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativePose {
    /// Row of the pose in which the other is given.
    pub first: usize,
    /// Row of the other pose.
    pub second: usize,
    /// Takes points of the second camera into the first.
    pub first_from_second: Pose,
    /// Inverse covariance of the step (translation, rotation) of the second camera, in its own frame.
    pub information: Matrix6<f64>,
}

/// Measurements of one adjustment. All rows are valid: [`super::adjust`] checks them.
#[derive(Debug, Clone)]
pub struct Problem {
    /// The camera of all poses.
    pub camera: StereoCamera,
    /// Which poses stay as they are. Without relative poses or places to hold the frame, at least one has to.
    pub fixed: Vec<bool>,
    /// What was seen.
    pub observations: Vec<Observation>,
    /// What was measured between poses.
    pub relative_poses: Vec<RelativePose>,
}

/// Poses and points.
#[derive(Debug, Clone)]
pub struct State {
    /// `session_from_camera`.
    pub poses: Vec<Pose>,
    /// In the session.
    pub points: Vec<Point3<f64>>,
}

/// Whitened residual of an observation and its derivatives.
pub(super) struct Linear {
    pub residual: Vector3<f64>,
    pub by_pose: Matrix3x6<f64>,
    pub by_point: Matrix3<f64>,
}

impl Observation {
    fn place_in_camera(&self, state: &State) -> (Vector3<f64>, Matrix3<f64>) {
        let pose = &state.poses[self.pose];
        let camera_from_session = pose.rotation.matrix().transpose();
        (camera_from_session * (state.points[self.point].coords - pose.translation.vector), camera_from_session)
    }

    /// Squared Mahalanobis distance to the state, `None` behind the camera.
    #[inline]
    pub(super) fn squared_error(&self, camera: &StereoCamera, state: &State) -> Option<f64> {
        let (place, _) = self.place_in_camera(state);
        let error = match self.measured {
            Measured::Picture(seen) => camera.project(&place)?.0 - seen,
            Measured::Place(seen) => place - seen,
        };
        Some((self.whitening * error).norm_squared())
    }

    /// The residual and its derivatives, `None` behind the camera.
    ///
    /// A step (rho, omega) of the camera moves a point p in it by -rho - omega x p.
    #[inline]
    pub(super) fn linear(&self, camera: &StereoCamera, state: &State) -> Option<Linear> {
        let (place, camera_from_session) = self.place_in_camera(state);
        let (error, slope) = match self.measured {
            Measured::Picture(seen) => {
                let (predicted, slope) = camera.project(&place)?;
                (predicted - seen, self.whitening * slope)
            }
            Measured::Place(seen) => (place - seen, self.whitening),
        };
        let mut by_pose = Matrix3x6::zeros();
        by_pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&-slope);
        by_pose.fixed_view_mut::<3, 3>(0, 3).copy_from(&(slope * skew(&place)));
        Some(Linear { residual: self.whitening * error, by_pose, by_point: slope * camera_from_session })
    }
}

impl RelativePose {
    fn predicted(&self, state: &State) -> (Pose, Vector6<f64>) {
        let predicted = state.poses[self.first].inv_mul(&state.poses[self.second]);
        (predicted, logarithm(&self.first_from_second.inv_mul(&predicted)))
    }

    /// Squared Mahalanobis distance to the state.
    pub(super) fn squared_error(&self, state: &State) -> f64 {
        let (_, error) = self.predicted(state);
        error.dot(&(self.information * error))
    }

    /// The residual and its derivatives by the first and the second pose.
    pub(super) fn linear(&self, state: &State) -> (Vector6<f64>, Matrix6<f64>, Matrix6<f64>) {
        let (predicted, error) = self.predicted(state);
        let turned = self.first_from_second.inv_mul(&predicted).rotation;
        let mut by_second = Matrix6::zeros();
        by_second.fixed_view_mut::<3, 3>(0, 0).copy_from(turned.matrix());
        by_second
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&inverse_right_jacobian(&error.fixed_rows::<3>(3).into_owned()));
        (error, -by_second * carried(&predicted), by_second)
    }
}

#[cfg(test)]
mod tests {
    use super::super::pose::moved;
    use super::*;
    use nalgebra::{Rotation3, Translation3};

    fn state() -> State {
        let first = Pose::from_parts(Translation3::new(0.1, 0.2, -0.3), Rotation3::from_euler_angles(0.3, -0.2, 0.1));
        let second = Pose::from_parts(Translation3::new(0.4, 0.1, -0.2), Rotation3::from_euler_angles(0.2, 0.1, 0.3));
        State { poses: vec![first, second], points: vec![Point3::new(0.3, -0.4, 2.0)] }
    }

    fn camera() -> StereoCamera {
        StereoCamera { focal_px: [417.0, 420.0], centre_px: [320.0, 180.0], baseline_m: 0.12 }
    }

    /// Derivative of `residual` by a step of one pose, by central differences.
    fn by_pose<const N: usize>(
        state: &State,
        pose: usize,
        residual: impl Fn(&State) -> nalgebra::SVector<f64, N>,
    ) -> nalgebra::SMatrix<f64, N, 6> {
        let mut matrix = nalgebra::SMatrix::<f64, N, 6>::zeros();
        for axis in 0..6 {
            let mut step = Vector6::zeros();
            step[axis] = 1e-6;
            let (mut ahead, mut back) = (state.clone(), state.clone());
            ahead.poses[pose] = moved(&state.poses[pose], &step);
            back.poses[pose] = moved(&state.poses[pose], &-step);
            matrix.set_column(axis, &((residual(&ahead) - residual(&back)) / 2e-6));
        }
        matrix
    }

    #[test]
    fn derivatives_of_observations_are_those_of_differences() {
        let (state, camera) = (state(), camera());
        let whitening = Matrix3::new(2.0, 0.1, 0.0, 0.0, 1.5, 0.2, 0.0, 0.0, 3.0);
        for measured in
            [Measured::Picture(Vector3::new(330.0, 100.0, 24.0)), Measured::Place(Vector3::new(0.1, 0.2, 1.9))]
        {
            let seen = Observation { pose: 0, point: 0, measured, whitening };
            let residual = |state: &State| seen.linear(&camera, state).expect("in front").residual;
            let linear = seen.linear(&camera, &state).expect("in front");
            let numeric = by_pose(&state, 0, residual);
            assert!((linear.by_pose - numeric).norm() < 1e-5 * numeric.norm(), "{measured:?}");
            for axis in 0..3 {
                let (mut ahead, mut back) = (state.clone(), state.clone());
                ahead.points[0][axis] += 1e-6;
                back.points[0][axis] -= 1e-6;
                let column = (residual(&ahead) - residual(&back)) / 2e-6;
                assert!((linear.by_point.column(axis) - column).norm() < 1e-4);
            }
        }
    }

    #[test]
    fn derivatives_of_relative_poses_are_those_of_differences() {
        let state = state();
        let first_from_second =
            Pose::from_parts(Translation3::new(0.2, -0.1, 0.1), Rotation3::from_euler_angles(0.0, 0.2, 0.1));
        let measured = RelativePose { first: 0, second: 1, first_from_second, information: Matrix6::identity() };
        let (_, by_first, by_second) = measured.linear(&state);
        let residual = |state: &State| measured.linear(state).0;
        // The inverse right Jacobian is cut after its second term: 1e-4 at these 20 degrees.
        assert!((by_first - by_pose(&state, 0, residual)).norm() < 1e-3);
        assert!((by_second - by_pose(&state, 1, residual)).norm() < 1e-3);
    }

    #[test]
    fn nothing_is_seen_behind_the_camera() {
        assert!(camera().project(&Vector3::new(0.1, 0.1, -1.0)).is_none());
    }
}
