//! Small changes of poses.
//!
//! A pose `session_from_camera` = (R, t) is changed on its right by xi = (rho, omega), metres and radians in the frame
//! of the camera: R <- R exp(omega), t <- t + R rho. So a step means the same wherever the session's origin lies.

use crate::pose::Pose;
use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3, Vector6};

/// The matrix of the cross product: `skew(a) * b` is a x b.
#[inline]
pub(crate) fn skew(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// The pose after the step xi.
#[inline]
pub(crate) fn moved(pose: &Pose, xi: &Vector6<f64>) -> Pose {
    let (rho, omega) = (xi.fixed_rows::<3>(0).into_owned(), xi.fixed_rows::<3>(3).into_owned());
    let mut rotation = pose.rotation * Rotation3::new(omega);
    // Rounding adds up over thousands of steps; one Newton step of the polar decomposition takes it out again.
    let matrix = *rotation.matrix();
    rotation = Rotation3::from_matrix_unchecked(matrix * (Matrix3::identity() * 3.0 - matrix.tr_mul(&matrix)) * 0.5);
    Pose { rotation, translation: pose.translation + pose.rotation * rho }
}

/// Residual (t, log R) of a measured relative pose, `error` = measured^-1 predicted.
#[inline]
pub(crate) fn logarithm(error: &Pose) -> Vector6<f64> {
    let (t, r) = (error.translation, error.turn());
    Vector6::new(t.x, t.y, t.z, r.x, r.y, r.z)
}

/// How a step of the first camera shows as a step of the second one, seen from the first: for the predicted pose P of
/// the second camera in the first, exp(-xi) P = P exp(-A xi).
#[inline]
pub(crate) fn carried(second_in_first: &Pose) -> Matrix6<f64> {
    let turned = second_in_first.rotation.matrix().transpose();
    let mut matrix = Matrix6::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&turned);
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-turned * skew(&second_in_first.translation)));
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&turned);
    matrix
}

/// Inverse of the right Jacobian of SO(3) at `rotation`, to second order: the derivative of log(R exp(omega)).
#[inline]
pub(super) fn inverse_right_jacobian(rotation: &Vector3<f64>) -> Matrix3<f64> {
    let cross = skew(rotation);
    Matrix3::identity() + cross * 0.5 + cross * cross / 12.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_of_the_first_camera_is_carried_to_the_second() {
        let second_in_first =
            Pose { rotation: Rotation3::from_euler_angles(0.2, -0.4, 0.6), translation: Vector3::new(0.3, -0.2, 0.5) };
        let xi = Vector6::new(1e-6, -2e-6, 3e-6, 2e-6, 1e-6, -1e-6);
        let direct = second_in_first.seen_from(&moved(&Pose::IDENTITY, &xi));
        let carried = moved(&second_in_first, &-(carried(&second_in_first) * xi));
        assert!((direct.to_matrix() - carried.to_matrix()).norm() < 1e-11);
    }

    #[test]
    fn a_pose_seen_from_itself_has_no_error() {
        // The trace of such a rotation is now and then larger than 3.
        for i in 0..2000 {
            let turn = Vector3::new(0.1, -0.2, 0.3) * (0.01 * f64::from(i));
            let pose = Pose { rotation: Rotation3::new(turn), translation: Vector3::new(0.3, -0.2, 0.5) };
            let again = moved(&pose, &Vector6::zeros());
            assert!(logarithm(&again.seen_from(&pose)).norm() < 1e-12, "{turn}");
        }
    }

    #[test]
    fn ten_thousand_steps_leave_a_rotation() {
        let step = Vector6::new(0.01, 0.0, 0.0, 0.02, -0.03, 0.01);
        let end = (0..10_000).fold(Pose::IDENTITY, |pose, _| moved(&pose, &step));
        let rotation = end.rotation.matrix();
        assert!((rotation.tr_mul(rotation) - Matrix3::identity()).norm() < 1e-12);
    }
}
