//! Poses between two centred clouds and their weighted least-squares steps.

use crate::geometry::{Scale, Similarity};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// `map = scale * rotation * query + translation`, both clouds about their own centres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placement {
    pub(crate) rotation: Matrix3<f64>,
    pub(crate) translation: Vector3<f64>,
    pub(crate) scale: f64,
}

impl Placement {
    pub(crate) fn identity() -> Self {
        Self { rotation: Matrix3::identity(), translation: Vector3::zeros(), scale: 1.0 }
    }

    #[inline]
    pub(crate) fn apply(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * p * self.scale + self.translation
    }

    /// A covariance of the query as the map sees it.
    pub(crate) fn seen_from_map(&self, covariance: &Matrix3<f64>) -> Matrix3<f64> {
        self.rotation * covariance * self.rotation.transpose() * (self.scale * self.scale)
    }

    /// The place in the query that lies at `p` in the map.
    #[inline]
    pub(crate) fn apply_inverse(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.tr_mul(&(p - self.translation)) / self.scale
    }

    /// The pose turned about what it makes of `middle`.
    #[inline]
    pub(crate) fn turned(&self, middle: &Vector3<f64>, turn: &Rotation3<f64>) -> Self {
        let rotation = turn * self.rotation;
        Self { rotation, translation: self.apply(middle) - rotation * middle * self.scale, scale: self.scale }
    }

    /// The pose turned about `middle` by an angle either way about each axis of the map.
    pub(crate) fn turned_either_way(&self, middle: &Vector3<f64>, angle_rad: f64) -> [Self; 6] {
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| axis * angle_rad);
        [-x, -y, -z, x, y, z].map(|turn| self.turned(middle, &Rotation3::new(turn)))
    }

    /// Angle of the rotation between two poses, radians.
    #[inline]
    pub(crate) fn turn_to(&self, other: &Self) -> f64 {
        let cosine = (self.rotation.component_mul(&other.rotation).sum() - 1.0) / 2.0;
        cosine.clamp(-1.0, 1.0).acos()
    }

    /// Placement in the clouds' own frames.
    pub(crate) fn to_similarity(self, centre_query: &Vector3<f64>, centre_map: &Vector3<f64>) -> Similarity {
        let mut rotation = Rotation3::from_matrix_unchecked(self.rotation);
        rotation.renormalize();
        let translation = centre_map + self.translation - rotation * centre_query * self.scale;
        Similarity { rotation, translation, scale: self.scale }
    }

    /// The reverse of [`Placement::to_similarity`].
    pub(crate) fn from_similarity(t: &Similarity, centre_query: &Vector3<f64>, centre_map: &Vector3<f64>) -> Self {
        Self {
            rotation: *t.rotation.matrix(),
            translation: t.rotation * centre_query * t.scale + t.translation - centre_map,
            scale: t.scale,
        }
    }
}

/// A fruit of the query where the grown pose puts it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Landing {
    pub(crate) place: Vector3<f64>,
    /// Variance per axis of the distance to the partner, square metres of the map.
    pub(crate) variance: f64,
}

/// Pairs, weighted, that fix a pose at the least: three and a half.
pub(super) const FIXING: f64 = 3.5;

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

    /// Adds another sum with a weight of its own.
    pub(crate) fn accumulate(&mut self, other: &Self, weight: f64) {
        self.weight += other.weight * weight;
        self.query += other.query * weight;
        self.map += other.map * weight;
        self.cross += other.cross * weight;
        self.square += other.square * weight;
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

    /// Inertia of the query's points about their centroid as `pose` turns and scales them; over the variance of a pair it is
    /// the inverse covariance of the turn.
    pub(crate) fn inertia_under(&self, pose: &Placement) -> Matrix3<f64> {
        let turned = pose.seen_from_map(&self.spread()) * self.weight;
        Matrix3::identity() * turned.trace() - turned
    }

    /// One Gauss-Newton step of the Procrustes problem from `start`, whose rotation must be near.
    ///
    /// Minimises the sum of w |m - s exp(w x) R q - t|^2 to first order in the turn: three linear equations instead
    /// of a singular value decomposition. `prior` (inverse variance in units of one pair's weight over square metres)
    /// holds the turn at `start` where the pairs do not fix it.
    pub(crate) fn step(&self, start: &Placement, scale: Scale, prior: f64) -> Option<Placement> {
        if self.weight <= 0.0 {
            return None;
        }
        let (mean_query, mean_map) = (self.query / self.weight, self.map / self.weight);
        let cross = self.cross - mean_map * mean_query.transpose() * self.weight;
        let square = self.square - mean_query * mean_query.transpose() * self.weight;
        let turned = start.rotation * square * start.rotation.transpose() * (start.scale * start.scale);
        let moved = cross * start.rotation.transpose() * start.scale; // sum of w m q'^T with q' = s R q
        // sum of w q' x m, from the antisymmetric part of the sum of m q'^T.
        let torque =
            Vector3::new(moved[(2, 1)] - moved[(1, 2)], moved[(0, 2)] - moved[(2, 0)], moved[(1, 0)] - moved[(0, 1)]);
        let inertia = Matrix3::identity() * (turned.trace() + prior) - turned;
        let turn = inertia.cholesky()?.solve(&torque);
        if !turn.iter().all(|x| x.is_finite()) {
            return None;
        }
        let rotation = Rotation3::new(turn).into_inner() * start.rotation;
        let scale = match scale {
            Scale::Metric => start.scale,
            Scale::Free => (cross * rotation.transpose()).trace() / square.trace(),
        };
        (scale > 0.0 && scale.is_finite()).then(|| Placement {
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
            let truth = Placement {
                rotation: Rotation3::new(Vector3::from(turn)).into_inner(),
                translation: Vector3::from(shift),
                scale,
            };
            let mut moments = Moments::default();
            for p in &points {
                let p = Vector3::from(*p);
                moments.add(&p, &truth.apply(&p), 1.0);
            }
            let mut pose = Placement { rotation: Matrix3::identity(), translation: Vector3::zeros(), scale: 1.0 };
            for _ in 0..30 {
                pose = moments.step(&pose, Scale::Free, 0.0).expect("random points span space");
            }
            prop_assert!(pose.turn_to(&truth) < 1e-6);
            prop_assert!((pose.scale - scale).abs() < 1e-9);
            prop_assert!((pose.translation - truth.translation).norm() < 1e-6);
        }
    }
}
