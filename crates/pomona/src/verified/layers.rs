//! How much denser strangers are where a cloud lies on itself than the kernels say.
//!
//! A row is made of walls, wires, a cordon, a roof, and a wrong pose lays these on themselves, moved along: then strangers meet
//! within the thickness of what they hang on. The kernels of [`super::chance`] are as flat as the cloud around, but the two
//! legs of a V, or wires above each other, do not show from sixty neighbours how thin each is. So the cloud is moved along
//! itself and its fruits that then meet are weighed as those of two visits would be: under the density that strangers
//! have, the mean of the likelihood ratio is one.

use crate::neighbours::others::{Neighbours, each_row};
use crate::principal::Principal;
use nalgebra::Vector3;

/// Noise under which fruits meet, in spacings: 2 to 4 cm in an orchard.
const NOISE: f64 = 0.1;

/// A cluster is narrower than this, in spacings: a cloud that is moved so far along itself meets other fruits.
pub(super) const BEYOND_A_CLUSTER: f64 = 0.6;

/// How far the cloud is moved, in spacings: not beyond the neighbours that are listed.
const MOVED: [f64; 2] = [BEYOND_A_CLUSTER, 1.6];

/// Standard deviations of a count that are taken off: of three axes the one that shows most counts, and a dozen fruits show a layer
/// where there is none.
const UNSURE: f64 = 2.0;

/// How many times as dense as `density` says strangers are, less what few pairs may show by chance; 1 at the least.
///
/// Of the three axes of the cloud the one counts along which most fruits meet.
pub(super) fn denser(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64, density: &[f64]) -> f64 {
    let axes = Principal::of(points.iter()).map(|found| found.ways());
    let along = |axis| moved_along(&axis, points, neighbours, spacing, density);
    axes.into_iter().flatten().map(along).fold(1.0, f64::max)
}

/// Mean likelihood ratio of a fruit on the cloud moved along `axis`, either way, less `UNSURE` standard deviations.
fn moved_along(
    axis: &Vector3<f64>,
    points: &[Vector3<f64>],
    neighbours: &Neighbours,
    spacing: f64,
    density: &[f64],
) -> f64 {
    let places = points.iter().map(|p| p.dot(axis));
    let (first, last) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    let [from, to] = MOVED.map(|share| share * spacing);
    let variance = (NOISE * spacing).powi(2);
    let of_each = each_row(points.len(), |row| {
        let met = |&other: &u32| {
            let apart = points[other as usize] - points[row];
            let ahead = apart.dot(axis);
            let across = (apart.norm_squared() - ahead * ahead) / variance;
            let meets = (from..to).contains(&ahead.abs());
            let weight = if meets { (-0.5 * across).exp() } else { 0.0 };
            [weight, weight / density[other as usize]]
        };
        let [pairs, sum] = neighbours.of(row).iter().map(met).fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
        // Beyond its ends there is none of the cloud to meet.
        let x = points[row].dot(axis);
        let way = [last - x, x - first].map(|left| (left - from).clamp(0.0, to - from)).iter().sum::<f64>();
        [pairs, sum, way]
    });
    let [pairs, sum, way] = of_each.iter().fold([0.0; 3], |[a, b, c], [d, e, f]| [a + d, b + e, c + f]);
    // Both of a pair count the other.
    let pairs = 0.5 * pairs;
    if pairs == 0.0 {
        return 0.0;
    }
    sum / (2.0 * std::f64::consts::PI * variance * way) * (1.0 - UNSURE / pairs.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FruitCloud;
    use crate::statistics::{gaussian, upper_median};
    use crate::verified::fixture::Dice;
    use crate::verified::landscape::Landscape;

    /// Median density of fruits over that of fruits spread evenly in a box of 6 by 1 by 2 m, each where `hung` puts it.
    fn density(hung: impl Fn(Vector3<f64>, f64) -> Vector3<f64>) -> f64 {
        let mut dice = Dice(7);
        let fruit = |_: usize| {
            let place = Vector3::new(6.0 * dice.uniform(), dice.uniform() - 0.5, 2.0 * dice.uniform());
            hung(place, 0.02 * dice.normal().x).into()
        };
        let fruits: Vec<_> = (0..400).map(fruit).collect();
        let mut density = Landscape::new(&FruitCloud::from_positions(fruits)).density;
        upper_median(&mut density) * 12.0 / 400.0
    }

    #[test]
    fn strangers_are_as_dense_as_the_layer_they_hang_on_is_thin() {
        // Two centimetres of noise and half as much again that the density assumes: (2 pi)^(1/2) 3 cm of depth for 1 m.
        let legs = density(|p, off| Vector3::new(p.x, p.y.signum() * (0.3 + 0.36 * p.z) + off, p.z));
        assert!((0.5 * 5.0..0.5 * 20.0).contains(&legs), "{legs}");
        let box_of_fruits = density(|p, _| p);
        assert!((0.7..1.2).contains(&box_of_fruits), "{box_of_fruits}");
    }

    #[test]
    fn the_mean_likelihood_ratio_of_strangers_on_wires_is_near_one() {
        let mut dice = Dice(11);
        let mut visit = || -> Vec<Vector3<f64>> {
            let on_a_wire = |i: usize| Vector3::new(8.0 * dice.uniform(), 0.0, 0.4 * (i % 4) as f64);
            let wires: Vec<_> = (0..300).map(on_a_wire).collect();
            wires.into_iter().map(|p| p + 0.02 * dice.normal().component_mul(&Vector3::new(0.0, 1.0, 1.0))).collect()
        };
        let (query, map) = (visit(), visit());
        let cloud = FruitCloud::from_positions(map.iter().map(|&p| p.into()).collect());
        let landscape = Landscape::new(&cloud);
        let variance = (NOISE * landscape.spacing).powi(2);
        let ratio = |p: &Vector3<f64>| {
            let of = |(at, q): (usize, &Vector3<f64>)| {
                gaussian((q + landscape.centre - p).norm_squared(), variance) / landscape.density[at]
            };
            landscape.points.iter().enumerate().map(of).sum::<f64>()
        };
        let mean = query.iter().map(ratio).sum::<f64>() / query.len() as f64;
        assert!((0.7..1.6).contains(&mean), "{mean}");
    }
}
