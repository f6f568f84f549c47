//! Rigid and similarity transforms and their least-squares fits.

use crate::error::{Error, Result};
use crate::pose::{is_rotation, orthogonal};
use nalgebra::{Matrix3, Matrix4, Point3, Rotation3, Vector3};

/// `p -> scale * rotation * p + translation`; rigid where `scale` is 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Rotation.
    pub rotation: Rotation3<f64>,
    /// Translation, metres of the target.
    pub translation: Vector3<f64>,
    /// Length in the target over length in the source.
    pub scale: f64,
}

impl Default for Similarity {
    fn default() -> Self {
        Self::identity()
    }
}

impl Similarity {
    /// The transform that moves nothing.
    pub fn identity() -> Self {
        Self { rotation: Rotation3::identity(), translation: Vector3::zeros(), scale: 1.0 }
    }

    /// A transform without change of scale.
    pub fn rigid(rotation: Rotation3<f64>, translation: Vector3<f64>) -> Self {
        Self { rotation, translation, scale: 1.0 }
    }

    /// The image of a point.
    #[inline]
    pub fn apply(&self, point: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.image(&point.coords))
    }

    /// The image of a place, as seen from the origin.
    #[inline]
    pub(crate) fn image(&self, place: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * place * self.scale + self.translation
    }

    /// The place whose image is `place`.
    #[inline]
    pub(crate) fn preimage(&self, place: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.inverse_transform_vector(&(place - self.translation)) / self.scale
    }

    /// The image of a covariance.
    #[inline]
    pub(crate) fn image_of_covariance(&self, covariance: &Matrix3<f64>) -> Matrix3<f64> {
        let rotation = self.rotation.matrix();
        rotation * covariance * rotation.transpose() * (self.scale * self.scale)
    }

    /// The same, turned about the image of `middle`.
    #[inline]
    pub(crate) fn turned(&self, middle: &Vector3<f64>, turn: &Rotation3<f64>) -> Self {
        let rotation = turn * self.rotation;
        Self { rotation, translation: self.image(middle) - rotation * middle * self.scale, scale: self.scale }
    }

    /// The same, turned about the image of `middle` by an angle either way about each axis of the target.
    pub(crate) fn turned_either_way(&self, middle: &Vector3<f64>, angle_rad: f64) -> [Self; 6] {
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| axis * angle_rad);
        [-x, -y, -z, x, y, z].map(|turn| self.turned(middle, &Rotation3::new(turn)))
    }

    /// Angle between this rotation and another, radians.
    #[inline]
    pub(crate) fn turn_to(&self, other: &Self) -> f64 {
        let cosine = (self.rotation.matrix().component_mul(other.rotation.matrix()).sum() - 1.0) / 2.0;
        cosine.clamp(-1.0, 1.0).acos()
    }

    /// The same between places as seen from `source` and from `target`.
    pub(crate) fn about(&self, source: &Vector3<f64>, target: &Vector3<f64>) -> Self {
        Self { translation: self.image(source) - target, ..*self }
    }

    /// The transform that undoes this one.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        let scale = 1.0 / self.scale;
        Self { rotation, translation: -(rotation * self.translation) * scale, scale }
    }

    /// `self` after `first`: `a_from_b.compose(&b_from_c)` is `a_from_c`.
    #[must_use]
    pub fn compose(&self, first: &Self) -> Self {
        Self {
            rotation: self.rotation * first.rotation,
            translation: self.rotation * first.translation * self.scale + self.translation,
            scale: self.scale * first.scale,
        }
    }

    /// Takes a homogeneous matrix apart.
    ///
    /// # Errors
    /// The matrix is not finite, mirrors, shears or has another last row than 0, 0, 0, 1. The rounding of its digits is no shear: it is
    /// taken out of the rotation.
    pub fn from_matrix(matrix: &Matrix4<f64>) -> Result<Self> {
        let wrong = |reason| Err(Error::Similarity { reason });
        let linear = matrix.fixed_view::<3, 3>(0, 0).into_owned();
        let scale = linear.determinant().cbrt();
        if !(scale.is_finite() && scale > 0.0) {
            return wrong("found a mirrored or degenerate matrix, expected rotation, scale and translation");
        }
        let rotation = linear / scale;
        if !is_rotation(&rotation) {
            return wrong("found a sheared matrix, expected rotation, scale and translation");
        }
        let last = matrix.row(3);
        if (last[0].abs() + last[1].abs() + last[2].abs() + (last[3] - 1.0).abs()) > 1e-6 {
            return wrong("expected the last row 0, 0, 0, 1");
        }
        let translation: Vector3<f64> = matrix.fixed_view::<3, 1>(0, 3).into_owned();
        if !translation.iter().all(|x| x.is_finite()) {
            return wrong("expected finite numbers");
        }
        Ok(Self { rotation: orthogonal(Rotation3::from_matrix_unchecked(rotation)), translation, scale })
    }

    /// Checks that it is one, for its numbers may be anyone's.
    ///
    /// # Errors
    /// A number that is not finite, a scale that is not above 0, a rotation that is none.
    pub fn validate(&self) -> Result<()> {
        let is_scale = self.scale.is_finite() && self.scale > 0.0;
        if !(is_scale && self.translation.iter().all(|x| x.is_finite())) {
            return Err(Error::Similarity { reason: "expected finite numbers and a scale above 0" });
        }
        if !is_rotation(self.rotation.matrix()) {
            return Err(Error::Similarity { reason: "found a matrix that does more than turn, expected a rotation" });
        }
        Ok(())
    }

    /// Homogeneous 4x4 matrix with the scale folded in.
    pub fn to_matrix(&self) -> Matrix4<f64> {
        let mut matrix = (self.rotation.matrix() * self.scale).to_homogeneous();
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.translation);
        matrix
    }
}

/// Whether a fit may change the scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// Both clouds are in metres: rotation and translation only.
    #[default]
    Metric,
    /// The ratio of the scales is unknown: similarity.
    Free,
}

/// Least-squares `target_from_source` of weighted pairs (Procrustes; Umeyama 1991 where the scale is free).
///
/// `None` where the pairs do not fix a rotation: fewer than three, no weight, or all on one line (second singular
/// value of the cross-covariance below 1e-12 of the first).
pub fn fit(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    weights: Option<&[f64]>,
    scale: Scale,
) -> Option<Similarity> {
    let n = source.len().min(target.len());
    let weight = |i: usize| weights.map_or(1.0, |w| w[i]);
    let total: f64 = (0..n).map(weight).sum();
    if n < 3 || total <= 0.0 {
        return None;
    }
    let mean = |points: &[Point3<f64>]| {
        points[..n].iter().enumerate().fold(Vector3::zeros(), |sum, (i, p)| sum + p.coords * weight(i)) / total
    };
    let (mean_source, mean_target) = (mean(source), mean(target));
    let mut cross = Matrix3::zeros();
    let mut spread_source = 0.0;
    for i in 0..n {
        let (s, t) = (source[i].coords - mean_source, target[i].coords - mean_target);
        cross += t * s.transpose() * weight(i);
        spread_source += s.norm_squared() * weight(i);
    }
    let svd = cross.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    if svd.singular_values[1] <= 1e-12 * svd.singular_values[0] || spread_source <= 0.0 {
        return None;
    }
    // A reflection would fit a mirrored or noisy planar set better; the sign keeps the rotation proper.
    let sign = (u.determinant() * v_t.determinant()).signum();
    let signs = Vector3::new(1.0, 1.0, sign);
    let rotation = Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&signs) * v_t);
    let scale = match scale {
        Scale::Metric => 1.0,
        Scale::Free => svd.singular_values.dot(&signs) / spread_source,
    };
    if scale <= 0.0 || !scale.is_finite() {
        return None;
    }
    Some(Similarity { rotation, translation: mean_target - rotation * mean_source * scale, scale })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn similarity() -> impl Strategy<Value = Similarity> {
        (prop::array::uniform3(-3.0..3.0f64), prop::array::uniform3(-5.0..5.0f64), 0.2..5.0f64).prop_map(
            |(r, t, scale)| Similarity {
                rotation: Rotation3::new(Vector3::from(r)),
                translation: Vector3::from(t),
                scale,
            },
        )
    }

    fn points() -> impl Strategy<Value = Vec<Point3<f64>>> {
        prop::collection::vec(prop::array::uniform3(-2.0..2.0f64).prop_map(Point3::from), 5..20)
    }

    proptest! {
        #[test]
        fn fit_recovers_the_transform(truth in similarity(), source in points()) {
            let target: Vec<_> = source.iter().map(|p| truth.apply(p)).collect();
            let found = fit(&source, &target, None, Scale::Free).expect("random points are not collinear");
            prop_assert!((found.to_matrix() - truth.to_matrix()).norm() < 1e-8);
        }

        #[test]
        fn a_matrix_comes_apart_as_it_was_put_together(truth in similarity()) {
            let found = Similarity::from_matrix(&truth.to_matrix()).expect("a similarity");
            prop_assert!((found.to_matrix() - truth.to_matrix()).norm() < 1e-12 * truth.scale.max(1.0));
            let mut mirrored = truth.to_matrix();
            mirrored.column_mut(0).neg_mut();
            prop_assert!(Similarity::from_matrix(&mirrored).is_err());
        }

        #[test]
        fn inverse_undoes(transform in similarity(), source in points()) {
            let round = transform.inverse().compose(&transform);
            for p in &source {
                prop_assert!((round.apply(p) - p).norm() < 1e-10);
            }
        }
    }

    #[test]
    fn collinear_points_fix_no_rotation() {
        let line: Vec<_> = (0..5).map(|i| Point3::new(f64::from(i), 0.0, 0.0)).collect();
        assert!(fit(&line, &line, None, Scale::Metric).is_none());
    }

    #[test]
    fn a_mirror_is_not_fitted_by_a_reflection() {
        let source = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]].map(Point3::from);
        let target = source.map(|p| Point3::new(-p.x, p.y, p.z));
        let found = fit(&source, &target, None, Scale::Metric).expect("the points span space");
        assert!((found.rotation.matrix().determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_rounding_of_a_written_matrix_is_no_shear() {
        let truth = Similarity {
            rotation: Rotation3::from_euler_angles(0.4, -0.9, 2.0),
            translation: Vector3::new(3.0, -1.0, 0.5),
            scale: 1.7,
        };
        let written = truth.to_matrix().map(|x| (x * 1e4).round() / 1e4);
        let found = Similarity::from_matrix(&written).expect("a similarity with four decimals");
        assert!((found.rotation.matrix().transpose() * found.rotation.matrix() - Matrix3::identity()).norm() < 1e-9);
        assert!(found.rotation.angle_to(&truth.rotation) < 1e-4);
        let mut sheared = truth.to_matrix();
        sheared[(0, 1)] += 0.02;
        assert!(Similarity::from_matrix(&sheared).is_err());
        let twice = Similarity { rotation: Rotation3::from_matrix_unchecked(Matrix3::identity() * 2.0), ..truth };
        assert!(truth.validate().is_ok() && twice.validate().is_err());
    }
}
