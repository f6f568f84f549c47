//! Poses from the outline of two clouds that show the same trees.
//!
//! When the noise is as large as the gaps inside a cluster, no constellation survives, but two visits to the same
//! trees still have the same extent. The principal axes give the pose up to half-turns; annealed least squares, from
//! the width of a branch down to the noise, decides between them.

use super::axes::{HALF_TURNS, MIN_FRUITS, axes_of};
use super::hypothesis::{DETECTION, Hypothesis, Model};
use super::landscape::Landscape;
use super::soft::pulled;
use crate::geometry::{Scale, Similarity};
use crate::statistics::gaussian;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rayon::prelude::*;

/// Standard deviations of the annealing, in spacings of the map: from the width of a branch down to the noise at which the
/// half-turns are compared.
const ANNEALING: [f64; 10] = [1.2, 0.9, 0.7, 0.55, 0.45, 0.38, 0.32, 0.3, 0.3, 0.3];

/// The pose of the outline with the evidence of its fine structure; `None` where it is no better than chance.
pub(crate) fn hypothesis(query: &Landscape, map: &Landscape, model: &Model) -> Option<Hypothesis> {
    if query.len().min(map.len()) < MIN_FRUITS {
        return None;
    }
    let ((axes_query, extents_query), (axes_map, extents_map)) = (axes_of(query)?, axes_of(map)?);
    let ratio = match model.scale {
        Scale::Metric => 1.0,
        Scale::Free => extents_map.norm() / extents_query.norm(),
    };
    let [.., last] = ANNEALING;
    let annealed = |signs: [f64; 3]| {
        let turned = axes_map * Matrix3::from_diagonal(&Vector3::from(signs));
        let rotation = Rotation3::from_matrix_unchecked(turned * axes_query.transpose());
        let start = Similarity { rotation, translation: Vector3::zeros(), scale: ratio };
        let (pose, _) = pulled(query, map, model, &start, &ANNEALING);
        model.admits(&pose).then(|| (pose, fine_structure(query, map, &pose, last * map.spacing)))
    };
    let found: Vec<_> = HALF_TURNS.into_par_iter().filter_map(annealed).collect();
    let (pose, first) = found.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    if first < 0.5 * threshold(query) {
        return None;
    }
    let (sigma, sharp) = sharpest(query, map, &pose);
    if sharp < threshold(query) {
        return None;
    }
    let shared = beside(query, &pose, &axes_map, WIDE * map.spacing)
        .map(|aside| fine_structure(query, map, &aside, sigma))
        .fold(0.0, f64::max);
    let log_odds = sharp - shared;
    (log_odds > OUTSTANDING * threshold(query)).then(|| Hypothesis { pose, log_odds, place: Vector3::zeros(), sigma })
}

/// The pose moved along each of the axes, and turned about each, either way, so that fruits move by `distance`.
///
/// In a hedge, a pergola or the skin of a round crown fruits hang denser than the width of a branch tells, and layer
/// laid on layer gains anywhere. But it gains nearly as much a little aside, along the layer; fruits on fruits do not.
fn beside(
    query: &Landscape,
    pose: &Similarity,
    axes: &Matrix3<f64>,
    distance: f64,
) -> impl Iterator<Item = Similarity> {
    let directed = (0..3).flat_map(|i| [1.0, -1.0].map(|sign| axes.column(i) * sign));
    directed.flat_map(move |axis| {
        let arm2: f64 = query.points.iter().map(|p| (pose.rotation * p).cross(&axis).norm_squared()).sum();
        let arm = pose.scale * (arm2 / query.len() as f64).sqrt();
        let turn = Rotation3::new(axis * (distance / arm));
        let shifted = Similarity { translation: pose.translation + axis * distance, ..*pose };
        [shifted, Similarity { rotation: turn * pose.rotation, ..*pose }]
    })
}

/// Evidence in nats above which an outline is accepted: seven standard deviations of its sum under chance.
///
/// Over disjoint rows the sum has mean zero and a standard deviation of 0.9 per square root of fruits.
pub(crate) fn threshold(query: &Landscape) -> f64 {
    6.5 * (query.len() as f64).sqrt()
}

/// Share of the threshold by which the evidence exceeds the best beside it.
///
/// The pose is the best nearby, so that it stands out by chance too: by up to 4.5 per square root of fruits over
/// disjoint rows of a dozen kinds of planting, where this asks for 5.5; heavy noise leaves 6.5 and more of true poses.
const OUTSTANDING: f64 = 0.85;

/// The noise under which the fine structure speaks most for the pose, and what it says, nats.
fn sharpest(query: &Landscape, map: &Landscape, pose: &Similarity) -> (f64, f64) {
    SIGMAS
        .iter()
        .map(|&share| (share * map.spacing, fine_structure(query, map, pose, share * map.spacing)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((map.spacing, f64::NEG_INFINITY))
}

/// Whether fruits line up, given that crowns do: the density of the map's fruits at the width of the noise against
/// that at the width of a branch. Under a pose that lays crown on crown by chance the expectation is below zero.
fn fine_structure(query: &Landscape, map: &Landscape, pose: &Similarity, sigma: f64) -> f64 {
    let variance = sigma * sigma;
    let wide = WIDE * map.spacing * WIDE * map.spacing + variance;
    query
        .points
        .iter()
        .map(|p| {
            let place = pose.image(p);
            let (mut here, mut around) = (0.0, map.floor);
            map.near(&place, 2.5 * wide.sqrt(), |row| {
                let d2 = (map.points[row as usize] - place).norm_squared();
                here += gaussian(d2, variance);
                around += gaussian(d2, wide);
            });
            (1.0 - DETECTION + DETECTION * (here + map.floor) / around).ln()
        })
        .sum()
}

/// Noise in spacings that is tried: 1.5 to 11 cm in an orchard.
const SIGMAS: [f64; 8] = [0.05, 0.07, 0.09, 0.12, 0.16, 0.2, 0.26, 0.33];

/// Width in spacings of the crowns' structure that chance may share. So far aside fruits no longer lie on themselves at any
/// noise that is tried.
const WIDE: f64 = 0.9;
