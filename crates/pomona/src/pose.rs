//! Where a camera is: rigid transforms.

use crate::error::{Error, Result};
use nalgebra::{Matrix3, Matrix4, Rotation3, UnitQuaternion, Vector3};

/// A rigid transform, `session_from_camera` where nothing else is said: takes points of the camera into the session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Turns directions of the camera into the session's.
    pub rotation: Rotation3<f64>,
    /// Place of the camera in the session, metres.
    pub translation: Vector3<f64>,
}

impl Pose {
    /// Nothing moves.
    pub const IDENTITY: Self = Self {
        rotation: Rotation3::from_matrix_unchecked(Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
        translation: Vector3::new(0.0, 0.0, 0.0),
    };

    /// From a 4 x 4 matrix; the rounding of its digits is taken out of the rotation.
    ///
    /// # Errors
    /// Its upper left block is no rotation, or a number is not finite.
    pub fn from_matrix(session_from_camera: &Matrix4<f64>) -> Result<Self> {
        let Self { rotation, translation } = Self::from_exact_matrix(session_from_camera)?;
        Ok(Self { rotation: orthogonal(rotation), translation })
    }

    /// From a 4 x 4 matrix that was made from a pose: to the last bit.
    ///
    /// # Errors
    /// As [`Self::from_matrix`].
    pub fn from_exact_matrix(session_from_camera: &Matrix4<f64>) -> Result<Self> {
        let rotation: Matrix3<f64> = session_from_camera.fixed_view::<3, 3>(0, 0).into();
        let translation: Vector3<f64> = session_from_camera.fixed_view::<3, 1>(0, 3).into();
        if is_rotation(&rotation) && translation.iter().all(|x| x.is_finite()) {
            return Ok(Self { rotation: Rotation3::from_matrix_unchecked(rotation), translation });
        }
        Err(Error::Pose)
    }

    /// Checks that it is one, for its numbers may be anyone's.
    ///
    /// # Errors
    /// As [`Self::from_matrix`].
    pub fn validate(&self) -> Result<()> {
        Self::from_exact_matrix(&self.to_matrix()).map(|_| ())
    }

    /// The 4 x 4 matrix.
    pub fn to_matrix(&self) -> Matrix4<f64> {
        let mut matrix = self.rotation.to_homogeneous();
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.translation);
        matrix
    }

    /// This transform after another one: `a_from_b.after(&b_from_c)` is `a_from_c`.
    #[inline]
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        Self {
            rotation: self.rotation * first.rotation,
            translation: self.rotation * first.translation + self.translation,
        }
    }

    /// This pose in another one's frame: `session_from_b.seen_from(&session_from_a)` is `a_from_b`.
    #[inline]
    #[must_use]
    pub fn seen_from(&self, other: &Self) -> Self {
        let other_from_session = other.rotation.inverse();
        Self {
            rotation: other_from_session * self.rotation,
            translation: other_from_session * (self.translation - other.translation),
        }
    }

    /// The transform back: `camera_from_session`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// Its rotation as a vector: the axis, as long as the angle in radians.
    ///
    /// By way of a quaternion: the angle of a matrix is an arc cosine, which rounding next to identity makes NaN.
    #[inline]
    pub(crate) fn turn(&self) -> Vector3<f64> {
        UnitQuaternion::from_rotation_matrix(&self.rotation).scaled_axis()
    }

    /// A point of the session in the camera's frame.
    #[inline]
    pub fn to_camera(&self, in_session: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.inverse_transform_vector(&(in_session - self.translation))
    }

    /// A point of the camera in the session's frame.
    #[inline]
    pub fn to_session(&self, in_camera: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * in_camera + self.translation
    }

    pub(crate) fn covariance_to_camera(&self, in_session: &Matrix3<f64>) -> Matrix3<f64> {
        self.rotation.matrix().transpose() * in_session * self.rotation.matrix()
    }

    pub(crate) fn covariance_to_session(&self, in_camera: &Matrix3<f64>) -> Matrix3<f64> {
        self.rotation.matrix() * in_camera * self.rotation.matrix().transpose()
    }
}

/// Whether a matrix turns and does nothing else, but for the rounding of its digits.
///
/// Poses written with four digits are orthogonal to 3e-4; a scale of 1 % is no rounding.
pub(crate) fn is_rotation(matrix: &Matrix3<f64>) -> bool {
    (matrix * matrix.transpose() - Matrix3::identity()).abs().max() < 1e-3 && matrix.determinant() > 0.0
}

/// The nearest rotation to one that is nearly a rotation (Newton's steps of the polar decomposition).
pub(crate) fn orthogonal(rotation: Rotation3<f64>) -> Rotation3<f64> {
    let mut matrix = rotation.into_inner();
    for _ in 0..3 {
        matrix = matrix * (Matrix3::identity() * 3.0 - matrix.transpose() * matrix) / 2.0;
    }
    Rotation3::from_matrix_unchecked(matrix)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(angles: [f64; 3], place: [f64; 3]) -> Pose {
        let [roll, pitch, yaw] = angles;
        Pose { rotation: Rotation3::from_euler_angles(roll, pitch, yaw), translation: Vector3::from(place) }
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

    #[test]
    fn digits_are_taken_out_of_a_rotation_unless_they_are_wanted() {
        let written = pose([0.3, -0.2, 0.1], [1.0, 2.0, 3.0]).to_matrix().map(|x| (x * 1e6).round() / 1e6);
        let off = |pose: Pose| (pose.rotation.matrix().tr_mul(pose.rotation.matrix()) - Matrix3::identity()).norm();
        assert!(off(Pose::from_matrix(&written).expect("rigid")) < 1e-14);
        assert_eq!(Pose::from_exact_matrix(&written).expect("rigid").to_matrix(), written);
    }

    #[test]
    fn a_pose_seen_from_another_leads_back_to_it() {
        let (session_from_a, session_from_b) =
            (pose([0.3, -0.2, 0.1], [0.1, 0.2, -0.3]), pose([-0.1, 0.4, 0.2], [0.5, -0.2, 0.7]));
        let a_from_b = session_from_b.seen_from(&session_from_a);
        assert!((session_from_a.after(&a_from_b).to_matrix() - session_from_b.to_matrix()).norm() < 1e-12);
        let in_b = Vector3::new(0.3, 0.2, 1.5);
        assert!(
            (session_from_a.to_camera(&session_from_b.to_session(&in_b)) - a_from_b.to_session(&in_b)).norm() < 1e-12
        );
        assert!((session_from_a.inverse().after(&session_from_b).to_matrix() - a_from_b.to_matrix()).norm() < 1e-12);
    }

    #[test]
    fn a_pose_is_one_that_turns_and_does_nothing_else() {
        let good = pose([0.3, -0.2, 1.0], [1.0, 2.0, 3.0]);
        assert_eq!(good.validate(), Ok(()));
        let turned = |matrix: Matrix3<f64>| Pose { rotation: Rotation3::from_matrix_unchecked(matrix), ..good };
        for wrong in
            [Matrix3::zeros(), Matrix3::identity() * 2.0, Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0))]
        {
            assert_eq!(turned(wrong).validate(), Err(Error::Pose));
        }
        assert_eq!(turned(Matrix3::from_element(f64::NAN)).validate(), Err(Error::Pose));
        assert_eq!(pose([0.0; 3], [f64::NAN, 0.0, 0.0]).validate(), Err(Error::Pose));
    }
}
