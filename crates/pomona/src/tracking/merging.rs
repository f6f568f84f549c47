//! Fruits that cannot both be there are one.
//!
//! Two records at the distance d, S the sum of their covariances, are weighed as one fruit seen twice against two fruits
//! of a cluster, whose centres solid bodies keep apart:
//!
//! ```text
//! L = ln N3(d; 0, S) - ln[ rho Phi((|d| - solid (R1 + R2)) / sigma_d) ] - SEEN_TOGETHER n
//! ```
//!
//! rho is the density of other fruits around a fruit, `sigma_d` the deviation of S along d, and n the number of frames that
//! saw both: one fruit seldom has two boxes.

use super::config::TrackingConfig;
use super::landmark::{Estimate, Landmark, fused};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Other fruits around a fruit, per cubic metre: one or two within 12 cm.
const NEIGHBOURS_PER_M3: f64 = 200.0;

/// Nats against one fruit for each frame that has a box for either: one fruit in fifty has two boxes.
const SEEN_TOGETHER: f64 = 4.0;

/// Standard deviations within which partners are sought.
const REACH: f64 = 3.0;

/// A fruit as a solid body at a place that is not quite known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Centre, metres.
    pub centre: Vector3<f64>,
    /// Its covariance, square metres.
    pub covariance: Matrix3<f64>,
    /// Radius, metres.
    pub radius_m: f64,
}

impl Body {
    pub(crate) fn of(landmark: &Landmark) -> Self {
        let Estimate { centre, covariance } = landmark.estimate;
        Self { centre, covariance, radius_m: landmark.radius_m() }
    }
}

/// Log-odds that two records are one fruit, nats; `place_sigma_m` is what places of different times may differ by.
pub(crate) fn one_fruit_log_odds(
    a: &Body,
    b: &Body,
    frames_together: usize,
    place_sigma_m: f64,
    config: &TrackingConfig,
) -> f64 {
    let apart = b.centre - a.centre;
    let covariance = a.covariance + b.covariance + Matrix3::identity() * place_sigma_m.powi(2);
    let Some(inverse) = covariance.try_inverse() else { return f64::NEG_INFINITY };
    let one = -0.5 * (apart.dot(&(inverse * apart)) + ((2.0 * PI).powi(3) * covariance.determinant()).ln());
    let distance = apart.norm();
    // Where both are at one place, no direction is special.
    let along = if distance > 1e-9 {
        apart.dot(&(covariance * apart)).sqrt() / distance
    } else {
        (covariance.trace() / 3.0).sqrt()
    };
    let solid = normal_below((distance - config.solid * (a.radius_m + b.radius_m)) / along);
    one - (NEIGHBOURS_PER_M3 * solid).ln() - SEEN_TOGETHER * frames_together as f64
}

/// Normal distribution function, its logarithm good to 0.3 down to 1e-12; never 0.
fn normal_below(deviation: f64) -> f64 {
    if deviation > -3.0 {
        return 1.0 / (1.0 + (-deviation * (1.5976 + 0.070_565_992 * deviation * deviation)).exp());
    }
    // Mills: Phi(-x) < exp(-x^2 / 2) / (x sqrt(2 pi)).
    let x = -deviation.max(-7.0);
    (-0.5 * x * x).exp() / (x * (2.0 * PI).sqrt())
}

/// For every body the smallest index of those that are the same fruit.
///
/// `frames_of` are the frames that saw each body, ascending. `place_sigma_m` is the deviation of places between visits of
/// one part of the row: drift, before the poses are refined.
///
/// # Panics
/// If the two slices differ in length.
pub fn merge_duplicates(
    bodies: &[Body],
    frames_of: &[Vec<i64>],
    place_sigma_m: f64,
    config: &TrackingConfig,
) -> Vec<usize> {
    assert_eq!(bodies.len(), frames_of.len(), "frames are needed of every body");
    let mut groups = Groups::new(bodies, frames_of);
    let mut candidates: Vec<_> = neighbours(bodies, place_sigma_m, config)
        .into_iter()
        .map(|(a, b)| (groups.log_odds(a, b, place_sigma_m, config), a, b))
        .filter(|candidate| candidate.0 > config.merge_log_odds)
        .collect();
    candidates.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    for (_, a, b) in candidates {
        let (a, b) = (groups.root(a), groups.root(b));
        if a != b && groups.log_odds(a, b, place_sigma_m, config) > config.merge_log_odds {
            groups.join(a.min(b), a.max(b));
        }
    }
    (0..bodies.len()).map(|index| groups.root(index)).collect()
}

/// Pairs that are near enough to be weighed: a sweep along the longest extent.
fn neighbours(bodies: &[Body], place_sigma_m: f64, config: &TrackingConfig) -> Vec<(usize, usize)> {
    let axis = longest_axis(bodies);
    let reach = |body: &Body| config.solid * body.radius_m + REACH * body.covariance.diagonal().max().sqrt();
    let widest = bodies.iter().map(reach).fold(0.0, f64::max) + REACH * place_sigma_m;
    let mut order: Vec<usize> = (0..bodies.len()).collect();
    order.sort_by(|&a, &b| bodies[a].centre[axis].total_cmp(&bodies[b].centre[axis]).then(a.cmp(&b)));
    let mut pairs = Vec::new();
    for (k, &a) in order.iter().enumerate() {
        for &b in &order[k + 1..] {
            let apart = bodies[b].centre - bodies[a].centre;
            if apart[axis] > reach(&bodies[a]) + widest {
                break;
            }
            if apart.norm() <= reach(&bodies[a]) + reach(&bodies[b]) + REACH * place_sigma_m {
                pairs.push((a.min(b), a.max(b)));
            }
        }
    }
    pairs
}

fn longest_axis(bodies: &[Body]) -> usize {
    let extent = |axis: usize| {
        let along = || bodies.iter().map(|body| body.centre[axis]);
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
    };
    (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b)).then(b.cmp(&a))).unwrap_or(0)
}

/// Bodies joined so far; a group is named by its smallest member.
struct Groups {
    bodies: Vec<Body>,
    frames_of: Vec<Vec<i64>>,
    parent: Vec<usize>,
}

impl Groups {
    fn new(bodies: &[Body], frames_of: &[Vec<i64>]) -> Self {
        Self { bodies: bodies.to_vec(), frames_of: frames_of.to_vec(), parent: (0..bodies.len()).collect() }
    }

    fn root(&self, mut index: usize) -> usize {
        while self.parent[index] != index {
            index = self.parent[index];
        }
        index
    }

    fn log_odds(&self, a: usize, b: usize, place_sigma_m: f64, config: &TrackingConfig) -> f64 {
        let together = common(&self.frames_of[a], &self.frames_of[b]);
        one_fruit_log_odds(&self.bodies[a], &self.bodies[b], together, place_sigma_m, config)
    }

    fn join(&mut self, into: usize, from: usize) {
        self.parent[from] = into;
        let [a, b] = [into, from].map(|index| {
            let Body { centre, covariance, .. } = self.bodies[index];
            Estimate { centre, covariance }
        });
        let Estimate { centre, covariance } = fused(&a, &b);
        let radius_m = self.bodies[into].radius_m.max(self.bodies[from].radius_m);
        self.bodies[into] = Body { centre, covariance, radius_m };
        let taken = std::mem::take(&mut self.frames_of[from]);
        self.frames_of[into].extend(taken);
        self.frames_of[into].sort_unstable();
        self.frames_of[into].dedup();
    }
}

/// How many numbers two ascending lists share.
fn common(a: &[i64], b: &[i64]) -> usize {
    a.iter().filter(|&frame| b.binary_search(frame).is_ok()).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(x: f64, sigma_m: f64) -> Body {
        Body { centre: Vector3::new(x, 0.0, 0.0), covariance: Matrix3::identity() * sigma_m.powi(2), radius_m: 0.035 }
    }

    #[test]
    fn solid_fruits_beside_each_other_stay_two() {
        let bodies = [body(0.0, 0.004), body(0.07, 0.004)];
        let labels = merge_duplicates(&bodies, &[vec![1, 2], vec![5, 6]], 0.005, &TrackingConfig::default());
        assert_eq!(labels, [0, 1]);
    }

    #[test]
    fn two_records_in_one_place_are_one_unless_seen_together() {
        let bodies = [body(0.0, 0.004), body(0.6, 0.004), body(0.015, 0.004)];
        let config = TrackingConfig::default();
        let apart = merge_duplicates(&bodies, &[vec![1, 2], vec![1], vec![5, 6]], 0.01, &config);
        assert_eq!(apart, [0, 1, 0]);
        let together = merge_duplicates(&bodies, &[vec![1, 2, 3, 4], vec![1], vec![1, 2, 3, 4]], 0.01, &config);
        assert_eq!(together, [0, 1, 2]);
    }

    #[test]
    fn places_known_too_poorly_are_not_joined() {
        let bodies = [body(0.0, 0.1), body(0.05, 0.1)];
        let labels = merge_duplicates(&bodies, &[vec![1], vec![5]], 0.0, &TrackingConfig::default());
        assert_eq!(labels, [0, 1]);
    }

    #[test]
    fn the_normal_distribution_is_near_enough() {
        for (deviation, expected) in
            [(0.0, 0.5), (-1.0, 0.158_655), (-2.0, 0.022_750), (-4.0, 3.167e-5), (2.0, 0.977_25)]
        {
            assert!((normal_below(deviation).ln() - f64::ln(expected)).abs() < 0.1, "{deviation}");
        }
    }
}
