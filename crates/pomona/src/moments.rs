//! Sums over weighted pairs of places, and the least-squares step of a similarity that they give.

use crate::geometry::{Scale, Similarity};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Pairs, weighted, that fix a pose at the least: three and a half.
pub(crate) const FIXING: f64 = 3.5;

/// Sums of weighted pairs, enough for one least-squares step from a current pose.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Moments {
    pub(crate) weight: f64,
    query: Vector3<f64>,
    map: Vector3<f64>,
    /// Sum of w m q^T.
    cross: Matrix3<f64>,
    /// Sum of w q q^T.
    square: Matrix3<f64>,
}

impl Moments {
    #[inline]
    pub(crate) fn add(&mut self, query: &Vector3<f64>, map: &Vector3<f64>, weight: f64) {
        self.weight += weight;
        self.query += query * weight;
        self.map += map * weight;
        self.cross += map * (query * weight).transpose();
        self.square += query * (query * weight).transpose();
    }

    /// Sum of sums, each with a weight of its own.
    pub(crate) fn total<'a>(parts: impl Iterator<Item = (&'a Self, f64)>) -> Self {
        let mut sum = Self::default();
        for (part, weight) in parts {
            sum.weight += part.weight * weight;
            sum.query += part.query * weight;
            sum.map += part.map * weight;
            sum.cross += part.cross * weight;
            sum.square += part.square * weight;
        }
        sum
    }

    /// Centroid of the query's points.
    pub(crate) fn centroid(&self) -> Vector3<f64> {
        self.query / self.weight
    }

    /// Second moments of the query's points about their centroid, divided by the weight.
    pub(crate) fn spread(&self) -> Matrix3<f64> {
        let mean = self.centroid();
        self.square / self.weight - mean * mean.transpose()
    }

    /// Sum of the squared distances from the mean axis through the centroid.
    pub(crate) fn inertia(&self) -> f64 {
        self.weight * self.spread().trace() * 2.0 / 3.0
    }

    /// Inertia of the query's points about their centroid as `pose` turns and scales them; over the variance of a
    /// pair it is the inverse covariance of the turn.
    pub(crate) fn inertia_under(&self, pose: &Similarity) -> Matrix3<f64> {
        let turned = pose.image_of_covariance(&self.spread()) * self.weight;
        Matrix3::identity() * turned.trace() - turned
    }

    /// One Gauss-Newton step of the Procrustes problem from `start`, whose rotation must be near.
    ///
    /// Minimises the sum of w |m - s exp(w x) R q - t|^2 to first order in the turn: three linear equations instead
    /// of a singular value decomposition. `prior` (inverse variance in units of one pair's weight over square metres)
    /// holds the turn at `start` where the pairs do not fix it.
    pub(crate) fn step(&self, start: &Similarity, scale: Scale, prior: f64) -> Option<Similarity> {
        if self.weight <= 0.0 {
            return None;
        }
        let (mean_query, mean_map) = (self.query / self.weight, self.map / self.weight);
        let cross = self.cross - mean_map * mean_query.transpose() * self.weight;
        let square = self.square - mean_query * mean_query.transpose() * self.weight;
        let turned = start.image_of_covariance(&square);
        let moved = cross * start.rotation.matrix().transpose() * start.scale; // sum of w m q'^T with q' = s R q
        // sum of w q' x m, from the antisymmetric part of the sum of m q'^T.
        let torque =
            Vector3::new(moved[(2, 1)] - moved[(1, 2)], moved[(0, 2)] - moved[(2, 0)], moved[(1, 0)] - moved[(0, 1)]);
        let inertia = Matrix3::identity() * (turned.trace() + prior) - turned;
        let turn = inertia.cholesky()?.solve(&torque);
        if !turn.iter().all(|x| x.is_finite()) {
            return None;
        }
        let rotation = Rotation3::new(turn) * start.rotation;
        let scale = match scale {
            Scale::Metric => start.scale,
            Scale::Free => (cross * rotation.matrix().transpose()).trace() / square.trace(),
        };
        (scale > 0.0 && scale.is_finite()).then(|| Similarity {
            rotation,
            translation: mean_map - rotation * mean_query * scale,
            scale,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn steps_converge_to_the_pose(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 6..20),
            turn in prop::array::uniform3(-0.2..0.2f64),
            shift in prop::array::uniform3(-1.0..1.0f64),
            scale in 0.7..1.4f64,
        ) {
            let truth = Similarity {
                rotation: Rotation3::new(Vector3::from(turn)),
                translation: Vector3::from(shift),
                scale,
            };
            let mut moments = Moments::default();
            for p in &points {
                let p = Vector3::from(*p);
                moments.add(&p, &truth.image(&p), 1.0);
            }
            let mut pose = Similarity::identity();
            for _ in 0..30 {
                pose = moments.step(&pose, Scale::Free, 0.0).expect("random points span space");
            }
            prop_assert!(pose.turn_to(&truth) < 1e-6);
            prop_assert!((pose.scale - scale).abs() < 1e-9);
            prop_assert!((pose.translation - truth.translation).norm() < 1e-6);
        }
    }
}
