//! Which way the noise points.
//!
//! Depth errs more than what a picture shows across it, branches sink more than they swing. How the pairs lie off shows
//! that, and a pair that is off along that way is likelier one fruit than another that is as far off across it.

use super::patches::{Landing, Patchwork};
use crate::beliefs::Beliefs;
use nalgebra::{Matrix3, Vector3};

/// Squares of residuals over their variances, and the pairs that they are of.
type Seen = (Matrix3<f64>, f64);

/// Pairs that a pose takes up: it has six numbers, a pair three.
const FITTED: f64 = 2.0;

/// Noise in the depth of a row over that along it and up, where it is expected to be long; many pairs show their own.
const DEPTH: f64 = 2.0;

/// Shape of the noise, as it is expected and as pairs show it.
#[derive(Debug, Clone)]
pub(super) struct Direction {
    /// Root of the covariance that is expected; offsets are seen as if it were a sphere's.
    expected: Matrix3<f64>,
    all: Seen,
    /// What each fruit of the query adds to that.
    own: Vec<Seen>,
}

impl Default for Direction {
    fn default() -> Self {
        Self { expected: Matrix3::identity(), all: Seen::default(), own: Vec::new() }
    }
}

impl Direction {
    /// Expected to be long in the depth of a row with these axes.
    pub(super) fn long_in_depth(axes: &Matrix3<f64>) -> Self {
        let lengths = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, DEPTH));
        Self { expected: axes * lengths * axes.transpose(), ..Self::default() }
    }

    /// What was expected, before any pair.
    pub(super) fn as_expected(&self) -> Self {
        Self { expected: self.expected, ..Self::default() }
    }

    /// As it was expected, and as pairs show it by their probabilities.
    pub(super) fn seen(&self, laid: &Patchwork, beliefs: &Beliefs) -> Self {
        let own = vec![Seen::default(); laid.query.len()];
        let mut direction = Self { expected: self.expected, all: Seen::default(), own };
        let unit = self.expected.try_inverse().unwrap_or_else(Matrix3::identity);
        for (edge, probability) in beliefs.links() {
            let Some(Landing { place, variance }) = laid.predictions[edge.query as usize] else { continue };
            let off = unit * (laid.map.points[edge.map as usize] - place);
            let squares = off * off.transpose() * (probability / variance);
            for seen in [&mut direction.all, &mut direction.own[edge.query as usize]] {
                seen.0 += squares;
                seen.1 += probability;
            }
        }
        direction
    }

    /// Covariance of the noise over its mean variance per axis, as all fruits but one of the query show it.
    ///
    /// A stranger that is paired lies off some way; with it the shape would turn to it, and it would look likelier than it
    /// is. And few pairs are long some way by chance. So what n normal pairs show, S, is drawn to what is expected, seen as a
    /// sphere, by the share that chance has in its squared distance from one, `(9 + |S|^2 / 3) / (n + 1 / 3)` of it (Chen et
    /// al. 2010, in three dimensions, with a trace of 3); n is less what the pose takes up.
    pub(super) fn without(&self, row: usize) -> Matrix3<f64> {
        let (squares, count) = self.own.get(row).map_or(self.all, |own| (self.all.0 - own.0, self.all.1 - own.1));
        let (shape, round) = (squares * (3.0 / squares.trace()), Matrix3::identity());
        let chance = (9.0 + shape.norm_squared() / 3.0) / ((count - FITTED).max(0.0) + 1.0 / 3.0);
        let off = (shape - round).norm_squared();
        let seen = if off > chance { shape + (round - shape) * (chance / off) } else { round };
        let shape = self.expected * seen * self.expected;
        shape * (3.0 / shape.trace())
    }

    /// Variances of the noise along its axes, over their mean, as all fruits show them.
    pub(super) fn variances(&self) -> [f64; 3] {
        // Drawn to a sphere none is below zero but by rounding.
        self.without(usize::MAX).symmetric_eigenvalues().map(|variance| variance.max(1e-3)).into()
    }

    /// Variance in the depth of a row over the mean, as pairs show it where a sphere is expected.
    pub(super) fn in_depth(&self, axes: &Matrix3<f64>) -> f64 {
        let (squares, depth) = (self.all.0, axes.column(2));
        3.0 * depth.dot(&(squares * depth)) / squares.trace()
    }
}

/// A bound of the largest eigenvalue of a shape, whose trace is 3: the shape's own where it has an axis of symmetry.
pub(super) fn longest(shape: &Matrix3<f64>) -> f64 {
    1.0 + (2.0 / 3.0 * (shape - Matrix3::identity()).norm_squared()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verified::fixture::Dice;

    /// What so many pairs show whose noise has these standard deviations.
    fn seen(count: usize, deviations: [f64; 3]) -> Direction {
        let mut dice = Dice(5);
        let own: Vec<Seen> = (0..count)
            .map(|_| {
                let off = dice.normal().component_mul(&Vector3::from(deviations));
                (off * off.transpose(), 1.0)
            })
            .collect();
        let all = own.iter().fold(Seen::default(), |all, own| (all.0 + own.0, all.1 + own.1));
        Direction { all, own, ..Direction::default() }
    }

    #[test]
    fn few_pairs_of_round_noise_show_no_way_and_many_that_are_long_show_theirs() {
        let nobody = usize::MAX;
        let off_round = |count: usize| (seen(count, [1.0; 3]).without(nobody) - Matrix3::identity()).norm();
        assert!([10, 30, 100, 300].into_iter().all(|count| off_round(count) < 0.4));
        let long = seen(400, [1.0, 1.0, 2.0]).without(nobody);
        assert!((long - Matrix3::from_diagonal(&Vector3::new(0.5, 0.5, 2.0))).norm() < 0.25, "{long}");
        assert!((long.trace() - 3.0).abs() < 1e-12);
    }

    #[test]
    fn few_pairs_leave_what_is_expected_and_many_do_not() {
        let nobody = usize::MAX;
        let expected = Direction::long_in_depth(&Matrix3::identity());
        assert!((expected.variances().iter().fold(0.0f64, |most, &v| most.max(v)) - 2.0).abs() < 1e-12);
        let over = |count, deviations| Direction { expected: expected.expected, ..seen(count, deviations) };
        // Offsets as the expected noise has them: a sphere's, and half as long in depth.
        assert!((over(20, [1.0; 3]).without(nobody) - expected.without(nobody)).norm() < 0.5);
        assert!((over(400, [1.0, 1.0, 0.5]).without(nobody) - Matrix3::identity()).norm() < 0.25);
    }

    #[test]
    fn a_fruit_is_not_asked_about_its_own_partner() {
        let mut direction = seen(40, [1.0; 3]);
        let far = Vector3::z() * 6.0;
        for seen in [&mut direction.all, &mut direction.own[7]] {
            seen.0 += far * far.transpose();
        }
        assert!(direction.without(8)[(2, 2)] > 1.2 && direction.without(7)[(2, 2)] < 1.1);
    }

    #[test]
    fn one_pair_or_none_shows_nothing() {
        assert_eq!(Direction::default().without(0), Matrix3::identity());
        assert_eq!(seen(1, [1.0; 3]).without(0), Matrix3::identity());
        assert_eq!(seen(1, [1.0; 3]).without(1), Matrix3::identity());
    }

    #[test]
    fn no_eigenvalue_exceeds_the_bound() {
        for shape in [[1.0; 3], [0.5, 0.5, 2.0], [0.1, 1.2, 1.7], [1.4, 1.4, 0.2]] {
            let most = shape.into_iter().fold(0.0, f64::max);
            let bound = longest(&Matrix3::from_diagonal(&Vector3::from(shape)));
            assert!(bound > most - 1e-12 && bound < 1.3 * most, "{bound} {most}");
        }
    }
}
