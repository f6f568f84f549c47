//! What was measured, and how far a state of poses and points is from it.

use super::steps::{carried, inverse_right_jacobian, logarithm, skew};
use crate::camera::Camera;
use crate::pose::Pose;
use nalgebra::{Matrix3, Matrix3x6, Matrix6, Point3, Vector3, Vector6};

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
pub struct PointView {
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
    /// Whether it may be wrong altogether: of another place that looks the same.
    pub doubtful: bool,
}

/// Measurements of one adjustment. All rows are valid: [`super::adjust`] checks them.
#[derive(Debug, Clone)]
pub struct Problem {
    /// The camera of all poses. A disparity needs its baseline.
    pub camera: Camera,
    /// Which poses stay as they are. Without relative poses or places to hold the frame, at least one has to.
    pub fixed: Vec<bool>,
    /// What was seen.
    pub observations: Vec<PointView>,
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

impl PointView {
    fn place_in_camera(&self, state: &State) -> (Vector3<f64>, Matrix3<f64>) {
        let pose = &state.poses[self.pose];
        let camera_from_session = pose.rotation.matrix().transpose();
        (camera_from_session * (state.points[self.point].coords - pose.translation), camera_from_session)
    }

    /// Squared Mahalanobis distance to the state, `None` behind the camera.
    #[inline]
    pub(super) fn squared_error(&self, camera: &Camera, state: &State) -> Option<f64> {
        let (place, _) = self.place_in_camera(state);
        let error = match self.measured {
            Measured::Picture(seen) => camera.project_pair(&place)?.0 - seen,
            Measured::Place(seen) => place - seen,
        };
        Some((self.whitening * error).norm_squared())
    }

    /// The residual and its derivatives, `None` behind the camera.
    ///
    /// A step (rho, omega) of the camera moves a point p in it by -rho - omega x p.
    #[inline]
    pub(super) fn linear(&self, camera: &Camera, state: &State) -> Option<Linear> {
        let (place, camera_from_session) = self.place_in_camera(state);
        let (error, slope) = match self.measured {
            Measured::Picture(seen) => {
                let (predicted, slope) = camera.project_pair(&place)?;
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
        let predicted = state.poses[self.second].seen_from(&state.poses[self.first]);
        (predicted, logarithm(&predicted.seen_from(&self.first_from_second)))
    }

    /// Squared Mahalanobis distance to the state.
    pub(super) fn squared_error(&self, state: &State) -> f64 {
        let (_, error) = self.predicted(state);
        error.dot(&(self.information * error))
    }

    /// The residual and its derivatives by the first and the second pose.
    pub(super) fn linear(&self, state: &State) -> (Vector6<f64>, Matrix6<f64>, Matrix6<f64>) {
        let (predicted, error) = self.predicted(state);
        let turned = predicted.seen_from(&self.first_from_second).rotation;
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
    use super::super::steps::moved;
    use super::*;
    use nalgebra::Rotation3;

    fn state() -> State {
        let first =
            Pose { rotation: Rotation3::from_euler_angles(0.3, -0.2, 0.1), translation: Vector3::new(0.1, 0.2, -0.3) };
        let second =
            Pose { rotation: Rotation3::from_euler_angles(0.2, 0.1, 0.3), translation: Vector3::new(0.4, 0.1, -0.2) };
        State { poses: vec![first, second], points: vec![Point3::new(0.3, -0.4, 2.0)] }
    }

    fn camera() -> Camera {
        Camera { width: 640, height: 360, fx: 417.0, fy: 420.0, cx: 320.0, cy: 180.0, baseline_m: Some(0.12) }
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
            let seen = PointView { pose: 0, point: 0, measured, whitening };
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
            Pose { rotation: Rotation3::from_euler_angles(0.0, 0.2, 0.1), translation: Vector3::new(0.2, -0.1, 0.1) };
        let measured =
            RelativePose { first: 0, second: 1, first_from_second, information: Matrix6::identity(), doubtful: false };
        let (_, by_first, by_second) = measured.linear(&state);
        let residual = |state: &State| measured.linear(state).0;
        // The inverse right Jacobian is cut after its second term: 1e-4 at these 20 degrees.
        assert!((by_first - by_pose(&state, 0, residual)).norm() < 1e-3);
        assert!((by_second - by_pose(&state, 1, residual)).norm() < 1e-3);
    }
}
