//! Where the camera is according to the fruits: known ones against poses that are noisy or drift.
//!
//! Noise of a pose moves all boxes of a frame alike, so the boxes themselves tell it. With p the place of a fruit in the
//! camera and J the derivative of its projection, a motion of (a, w) moves what is seen of it by J (a + w x p). The motion
//! minimises
//!
//! ```text
//! sum_i rho(|r_i - J_i (a + w x p_i)|^2_S_i) + |a|^2 / sigma_t^2 + |w|^2 / sigma_r^2
//! ```
//!
//! over the residuals r of assigned fruits, S their covariances, rho Cauchy's. Where poses are right, the minimum says
//! nothing that noise would not say, and nothing is moved.

use super::association::Association;
use super::config::TrackingConfig;
use super::known::Known;
use super::likelihood::Residual;
use super::prediction::{Appearance, Prediction};
use crate::camera::Camera;
use crate::pose::Pose;
use nalgebra::{Matrix2, Matrix2x3, Matrix6, Rotation3, SMatrix, Vector3, Vector6};

/// Assigned fruits without which nothing is said: twice as many numbers as a motion has.
const LEAST_FRUITS: usize = 6;

/// Steps of the robust fit.
const STEPS: usize = 5;

/// What the sum of squares must fall by: chi^2 of six degrees of freedom, exceeded by chance in one frame of 10,000.
const SIGNIFICANT: f64 = 27.9;

/// The pose that fruits placed by several frames ask for: the given one where they do not contradict it, None where they
/// are too few to say.
pub(crate) fn aligned(
    pose: &Pose,
    (predictions, association, known): (&[Prediction], &Association, &Known),
    camera: &Camera,
    config: &TrackingConfig,
) -> Option<Pose> {
    let is_placed = |prediction: &Prediction| known.landmarks[prediction.landmark].is_placed();
    let pulls: Vec<Pull> = predictions
        .iter()
        .enumerate()
        .filter(|(_, prediction)| is_placed(prediction))
        .filter_map(|(p, prediction)| {
            let weighed = association.weighed.get(&(p, association.box_of[p]?))?;
            Pull::new(&prediction.likely, weighed.likely.as_ref()?, camera)
        })
        .collect();
    if pulls.len() < LEAST_FRUITS {
        return None;
    }
    let (motion, gain) = fit(&pulls, config)?;
    Some(if gain > SIGNIFICANT { moved(pose, &motion) } else { *pose })
}

/// What one fruit says about the motion: information and information vector, unweighted; its squared residual.
struct Pull {
    information: Matrix6<f64>,
    vector: Vector6<f64>,
    square: f64,
    dimensions: f64,
}

impl Pull {
    fn new(appearance: &Appearance, residual: &Residual, camera: &Camera) -> Option<Self> {
        let p = appearance.in_camera;
        let projection = camera.projection_jacobian(&p);
        match &residual.lifted {
            Some((value, noise)) if residual.depth_fits > 0.5 => {
                let weight = (appearance.covariance + noise).try_inverse()?;
                Some(Self::of(&by_motion(&projection, &p), &weight, value))
            }
            _ => {
                let (value, noise) = &residual.across;
                let spread = Matrix2::from(appearance.covariance.fixed_view::<2, 2>(0, 0));
                let rows: Matrix2x3<f64> = projection.fixed_rows::<2>(0).into();
                Some(Self::of(&by_motion(&rows, &p), &(spread + noise).try_inverse()?, value))
            }
        }
    }

    fn of<const D: usize>(
        jacobian: &SMatrix<f64, D, 6>,
        weight: &SMatrix<f64, D, D>,
        value: &SMatrix<f64, D, 1>,
    ) -> Self {
        let weighted = jacobian.transpose() * weight;
        Self {
            information: weighted * jacobian,
            vector: weighted * value,
            square: value.dot(&(weight * value)),
            dimensions: D as f64,
        }
    }

    /// Squared residual after a motion.
    fn square_after(&self, motion: &Vector6<f64>) -> f64 {
        self.square - 2.0 * motion.dot(&self.vector) + motion.dot(&(self.information * motion))
    }
}

/// Derivative of what is seen by (a, w): `J [I, -[p]x]`.
fn by_motion<const D: usize>(projection: &SMatrix<f64, D, 3>, p: &Vector3<f64>) -> SMatrix<f64, D, 6> {
    let mut jacobian = SMatrix::<f64, D, 6>::zeros();
    jacobian.fixed_view_mut::<D, 3>(0, 0).copy_from(projection);
    jacobian.fixed_view_mut::<D, 3>(0, 3).copy_from(&(projection * -p.cross_matrix()));
    jacobian
}

/// The motion, and by how much it lowers the weighted sum of squares.
fn fit(pulls: &[Pull], config: &TrackingConfig) -> Option<(Vector6<f64>, f64)> {
    let inverse_variance = |sigma: f64| 1.0 / sigma.max(1e-9).powi(2);
    let (place, turn) = (inverse_variance(config.pose_sigma_m), inverse_variance(config.pose_sigma_rad));
    let prior = Matrix6::from_diagonal(&Vector6::new(place, place, place, turn, turn, turn));
    let (mut motion, mut gain) = (Vector6::zeros(), 0.0);
    for _ in 0..STEPS {
        let (mut information, mut vector) = (prior, Vector6::zeros());
        for pull in pulls {
            let weight = 1.0 / (1.0 + pull.square_after(&motion) / pull.dimensions);
            information += pull.information * weight;
            vector += pull.vector * weight;
        }
        motion = information.try_inverse()? * vector;
        gain = motion.dot(&vector);
    }
    Some((motion, gain))
}

/// The camera's pose when what it sees moves by `motion`.
fn moved(pose: &Pose, motion: &Vector6<f64>) -> Pose {
    let turn = Rotation3::new(motion.fixed_rows::<3>(3).into_owned());
    let shift: Vector3<f64> = motion.fixed_rows::<3>(0).into();
    // session_from_camera (a, w)^-1
    pose.after(&Pose { rotation: turn, translation: shift }.inverse())
}
