//! Which way companions lie.
//!
//! Fruits hang on strings, arms and wires, and what hangs beside a fruit lies along these: so does a stranger that is taken for it. One that
//! is seen again lies off as noise does. Were strangers expected all around, those along the strings would look like noise that is long that
//! way, and be believed ([`super::direction`]).
//!
//! Directions u of companions at a distance have the density `(u^T A u)^(-3/2)`, det A = 1, over that of even ones: the angular central
//! Gaussian (Tyler 1987). For every A its mean over all directions is one, so that the number of companions stays what it is.

use super::chance::{BIN, Companions};
use crate::neighbours::others::Neighbours;
use nalgebra::{Matrix3, Vector3};

/// Bins of distance that have one shape.
const BAND: usize = 3;

/// Companions nearer and farther by this part of the distance count too: their directions change little.
const AROUND: f64 = 1.0 / 3.0;

/// Directions of as many companions count as one that is independent: each pair is seen from both its ends, and those of a string lie on one
/// line.
const ALIKE: f64 = 8.0;

/// Steps of the search for a shape at the most, and the change that ends it.
const STEPS: usize = 30;
const STILL: f64 = 1e-3;

/// Directions of companions by their distance.
#[derive(Debug, Clone)]
pub(super) struct Bearings {
    /// Metres of a band.
    band: f64,
    /// A of each band.
    shapes: Vec<Matrix3<f64>>,
}

impl Bearings {
    pub(super) fn new(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64) -> Self {
        let band = BAND as f64 * BIN * spacing;
        let mut squares = vec![Matrix3::zeros(); Companions::BINS / BAND];
        for (row, p) in points.iter().enumerate() {
            for &other in neighbours.of(row) {
                let apart = points[other as usize] - p;
                let distance = apart.norm();
                if let Some(sum) = squares.get_mut((distance / band) as usize).filter(|_| distance > 0.0) {
                    *sum += apart * apart.transpose() / (distance * distance);
                }
            }
        }
        let shape = |at: usize| {
            let reach = (AROUND * at as f64).round() as usize;
            shape_of(squares[at.saturating_sub(reach)..(at + reach + 1).min(squares.len())].iter().sum())
        };
        Self { band, shapes: (0..squares.len()).map(shape).collect() }
    }

    /// Density of companions that lie off like this, over the mean of all directions.
    pub(super) fn towards(&self, off: &Vector3<f64>) -> f64 {
        let distance2 = off.norm_squared();
        let band = ((distance2.sqrt() / self.band) as usize).min(self.shapes.len() - 1);
        let squared = off.dot(&(self.shapes[band] * off));
        if squared > 0.0 { (distance2 / squared).powf(1.5) } else { 1.0 }
    }
}

/// A of directions with this sum of u u^T.
///
/// The mean of n even directions is off that of all by `2 / (3 n)` in squared distance, by chance; by that share of what it is off it is drawn
/// to it.
fn shape_of(squares: Matrix3<f64>) -> Matrix3<f64> {
    let even = Matrix3::identity() / 3.0;
    let off = squares / squares.trace().max(f64::MIN_POSITIVE) - even;
    let chance = 2.0 / 3.0 * ALIKE / squares.trace().max(f64::MIN_POSITIVE);
    if off.norm_squared() <= chance {
        return Matrix3::identity();
    }
    let found = (even + off * (1.0 - chance / off.norm_squared())).symmetric_eigen();
    let mut lengths = Vector3::repeat(1.0);
    for _ in 0..STEPS {
        let before = lengths;
        lengths.component_mul_assign(&found.eigenvalues.component_div(&mean_square(&lengths)));
        lengths /= lengths.product().cbrt();
        if (lengths - before).norm() < STILL * lengths.norm() {
            break;
        }
    }
    let inverse = Matrix3::from_diagonal(&lengths.map(f64::recip));
    found.eigenvectors * inverse * found.eigenvectors.transpose()
}

/// Mean of the squares of u along the axes, u the directions of a Gaussian with these variances l:
/// `integral of l / 2 / (1 + l t) / prod sqrt(1 + l t) dt`, by steps of ln t.
fn mean_square(variances: &Vector3<f64>) -> Vector3<f64> {
    let at = |step: i32| {
        let t = f64::from(step).exp();
        let terms = variances.map(|variance| 1.0 + variance * t);
        variances.component_div(&terms) * (t / terms.product().sqrt())
    };
    let sum: Vector3<f64> = (-12..=12).map(at).sum();
    sum / sum.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::verified::fixture::Dice;
    use crate::verified::landscape::Landscape;

    /// Density of companions along the vertical over the mean, and across it, 4 cm off, of fruits 4 cm apart on 60 strings that point
    /// up by so much, in a box of 4 x 1 x 2 m.
    fn around(up: f64) -> [f64; 2] {
        let mut dice = Dice(7);
        let strings = (0..60).flat_map(|_| {
            let foot = Vector3::new(4.0, 1.0, 2.0).map(|length| length * dice.uniform());
            let way = (Vector3::z() * up + dice.normal()).normalize();
            let jitter: Vec<_> = (0..6).map(|_| dice.normal() * 0.004).collect();
            jitter.into_iter().zip(0..).map(move |(off, step)| (foot + way * (0.04 * f64::from(step)) + off).into())
        });
        let cloud = Landscape::new(&FruitCloud::from_positions(strings.collect()));
        let found = cloud.bearings();
        [found.towards(&(Vector3::z() * 0.04)), found.towards(&(Vector3::x() * 0.04))]
    }

    #[test]
    fn companions_lie_along_strings_that_hang_down_and_all_around_where_each_points_elsewhere() {
        let [along, across] = around(30.0);
        assert!(along > 10.0 && across < 0.3, "{along} {across}");
        let [along, across] = around(0.0);
        assert!((0.4..2.5).contains(&along) && (0.4..2.5).contains(&across), "{along} {across}");
    }

    #[test]
    fn a_shape_has_the_mean_squares_that_it_was_made_of_and_even_directions_have_none() {
        let wanted = Vector3::new(0.7, 0.2, 0.1);
        let shape = shape_of(Matrix3::from_diagonal(&wanted) * 1e9);
        assert!((shape.determinant() - 1.0).abs() < 1e-9);
        let has = mean_square(&shape.diagonal().map(f64::recip));
        assert!((has - wanted).norm() < 0.01, "{has}");
        assert_eq!(shape_of(Matrix3::identity() * 100.0), Matrix3::identity());
        assert_eq!(shape_of(Matrix3::zeros()), Matrix3::identity());
    }

    #[test]
    fn the_mean_over_all_directions_is_one() {
        let lengths = Vector3::new(4.0, 1.0, 0.25);
        let found = Bearings { band: 1.0, shapes: vec![Matrix3::from_diagonal(&lengths)] };
        let mut dice = Dice(3);
        let mean = (0..20_000).map(|_| found.towards(&(dice.normal().normalize() * 0.5))).sum::<f64>() / 20_000.0;
        assert!((mean - 1.0).abs() < 0.03, "{mean}");
    }
}
