//! Seeded visits of an orchard for the tests.

use crate::cloud::FruitCloud;
use crate::random::shuffled;
use nalgebra::{Point3, Vector3};

/// Uniform numbers in 0..1 of a fixed sequence.
pub(super) struct Dice(pub(super) u64);

impl Dice {
    pub(super) fn uniform(&mut self) -> f64 {
        self.0 += 1;
        (shuffled(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Normal on each axis (Box and Muller).
    pub(super) fn normal(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| {
            (-2.0 * self.uniform().max(1e-300).ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
        })
    }
}

/// Clusters of three, 8 cm apart, in a box of 4 x 2 x 1 m; two visits that see 0.6 of them with `sigma` between them.
pub(super) fn visits(sigma: f64) -> (FruitCloud, FruitCloud) {
    visits_of(&Vector3::repeat(sigma))
}

/// The same with a standard deviation along each axis.
pub(super) fn visits_of(sigma: &Vector3<f64>) -> (FruitCloud, FruitCloud) {
    let mut dice = Dice(7);
    let (mut query, mut map) = (Vec::new(), Vec::new());
    for _ in 0..200 {
        let middle = Vector3::new(4.0 * dice.uniform(), 2.0 * dice.uniform(), dice.uniform());
        for _ in 0..3 {
            let fruit = middle + dice.normal() * 0.08 / 3f64.sqrt();
            for visit in [&mut query, &mut map] {
                if dice.uniform() < 0.6 {
                    visit.push(Point3::from(fruit + dice.normal().component_mul(sigma) / 2f64.sqrt()));
                }
            }
        }
    }
    (FruitCloud::from_positions(query), FruitCloud::from_positions(map))
}
