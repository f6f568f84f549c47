//! What chance puts at each place of a cloud: the density of strangers, near a fruit and at a distance from one.

use super::landscape::{Neighbours, SHARE_OF_ROWS};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Kernel estimate at each fruit from its neighbours, half at the width of a cluster, half at that of a branch.
///
/// Fruits hang in clusters: a wrong pose that lays one fruit on a cluster meets its other members for free. The
/// narrow kernel prices that in.
pub(super) fn local_density(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64, floor: f64) -> Vec<f64> {
    let kernel = |width: f64| {
        let scale = 0.5 / ((2.0 * std::f64::consts::PI).powf(1.5) * width.powi(3));
        (scale, -0.5 / (width * width))
    };
    let (narrow, wide) = (kernel(0.4 * spacing), kernel(0.8 * spacing));
    points
        .par_iter()
        .enumerate()
        .with_min_len(SHARE_OF_ROWS)
        .map(|(row, p)| {
            let sum: f64 = neighbours
                .of(row)
                .iter()
                .map(|&other| {
                    let d2 = (points[other as usize] - p).norm_squared();
                    narrow.0 * (narrow.1 * d2).exp() + wide.0 * (wide.1 * d2).exp()
                })
                .sum();
            sum + floor
        })
        .collect()
}

/// Expected density of companions at each fruit over the mean, from the number of its neighbours within the spacing.
///
/// Counts scatter more than a Poisson process of one density lets them: branches are crowded or bare. With a gamma
/// distribution of shape k over the places, n neighbours where m are the mean make it (k + n) / (k + m), and
/// var n = m + m^2 / k says what k is.
pub(super) fn crowding(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64) -> Vec<f64> {
    let within = |(row, p): (usize, &Vector3<f64>)| {
        let near = |other: &&u32| (points[**other as usize] - p).norm_squared() < spacing * spacing;
        neighbours.of(row).iter().take_while(near).count() as f64
    };
    let counts: Vec<f64> = points.iter().enumerate().map(within).collect();
    let total = counts.len().max(1) as f64;
    let mean = counts.iter().sum::<f64>() / total;
    let variance = counts.iter().map(|n| (n - mean).powi(2)).sum::<f64>() / total;
    let shape = mean * mean / (variance - mean).max(LEAST_CROWDING * mean).max(f64::MIN_POSITIVE);
    counts.iter().map(|n| (shape + n) / (shape + mean)).collect()
}

/// Variance of the counts beyond Poisson's, as a share of the mean, at the least.
const LEAST_CROWDING: f64 = 0.05;

/// The radial density of fruits around a fruit, from the cloud's own pairs.
///
/// Fruits of a cluster keep their distance and crowd beyond it: there is no companion at 3 cm and many at 8 cm. What
/// one visit shows around its own fruits is what chance shows around the fruits of another visit with the same noise.
#[derive(Debug, Clone)]
pub(super) struct Companions {
    inverse_bin: f64,
    densities: Vec<f64>,
}

impl Companions {
    /// Bins of an eighth of the spacing: 3 cm in an orchard.
    const BINS: usize = 12;
    const BIN: f64 = 0.125;

    pub(super) fn new(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64) -> Self {
        let inverse_bin = 1.0 / (Self::BIN * spacing);
        let mut densities = vec![0.0; Self::BINS];
        for (row, p) in points.iter().enumerate() {
            for &other in neighbours.of(row) {
                let bin = ((points[other as usize] - p).norm() * inverse_bin) as usize;
                if bin < Self::BINS {
                    densities[bin] += 1.0;
                }
            }
        }
        let shell = 4.0 / 3.0 * std::f64::consts::PI / inverse_bin.powi(3) * points.len().max(1) as f64;
        for (bin, density) in densities.iter_mut().enumerate() {
            let (inner, outer) = (bin as f64, bin as f64 + 1.0);
            *density /= shell * (outer.powi(3) - inner.powi(3));
        }
        Self { inverse_bin, densities }
    }

    /// Linear between the middles of the bins.
    pub(super) fn at(&self, distance: f64) -> f64 {
        let place = (distance * self.inverse_bin - 0.5).clamp(0.0, Self::BINS as f64 - 1.001);
        let (bin, rest) = (place as usize, place.fract());
        self.densities[bin] * (1.0 - rest) + self.densities[bin + 1] * rest
    }
}

/// Gaussian of the distance of every neighbour, as wide as the spacing: a branch's reach.
pub(super) fn kinship(points: &[Vector3<f64>], neighbours: &Neighbours, spacing: f64) -> Vec<f64> {
    let precision = -0.5 / (spacing * spacing);
    let of = |row: usize| {
        neighbours
            .of(row)
            .iter()
            .map(move |&other| (precision * (points[other as usize] - points[row]).norm_squared()).exp())
    };
    (0..points.len()).flat_map(of).collect()
}
