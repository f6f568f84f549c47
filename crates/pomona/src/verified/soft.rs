//! Soft registration: every fruit pulled by all fruits that hang about it, each as likely as it is the same one.
//!
//! The nearest fruit is a stranger where few are seen again. The likelihood of all of them together has a wide basin, and one
//! step of expectation and maximisation climbs most of it (coherent point drift, Myronenko and Song 2010, with a rigid pose).

use super::hypothesis::Model;
use super::landscape::Landscape;
use super::sight::Sight;
use crate::geometry::Similarity;
use crate::moments::Moments;
use crate::statistics::{Evidence, gaussian};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Standard deviations beyond which a fruit pulls no more.
const REACH: f64 = 2.0;

/// A pose after a step at each of the `widths`, in spacings of the map, and the log-likelihood ratio against strangers that led
/// to the last of them, nats.
pub(super) fn pulled(
    query: &Landscape,
    map: &Landscape,
    model: &Model,
    start: &Similarity,
    widths: &[f64],
) -> (Similarity, f64) {
    let (mut pose, mut nats) = (*start, 0.0);
    let sight = model.sight(query, map, start);
    for width in widths {
        let sigma = width * map.spacing;
        let pulls;
        (pulls, nats) = pulls_at([query, map], model, &pose, sigma, sight.as_ref());
        pose = model.step(&pulls, &pose, sigma).unwrap_or(pose);
    }
    (pose, nats)
}

/// Noise in spacings that is tried: 2 to 10 cm in an orchard.
const NOISES: [f64; 5] = [0.075, 0.11, 0.16, 0.23, 0.33];

/// The noise, metres, under which the fruits say most for one of the poses.
pub(super) fn sharpest(query: &Landscape, map: &Landscape, model: &Model, poses: &[Similarity]) -> f64 {
    let said = |pose: &Similarity| {
        let sight = model.sight(query, map, pose);
        NOISES.map(|share| share * map.spacing).map(|sigma| {
            let (_, nats) = pulls_at([query, map], model, pose, sigma, sight.as_ref());
            (nats, sigma)
        })
    };
    let said: Vec<[(f64, f64); 5]> = poses.par_iter().map(said).collect();
    said.into_iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0)).map_or(model.sigma, |(_, sigma)| sigma)
}

/// Where the fruits of the query are pulled when a pair has the noise `sigma`, and what they say for the pose, nats.
fn pulls_at(
    [query, map]: [&Landscape; 2],
    model: &Model,
    pose: &Similarity,
    sigma: f64,
    sight: Option<&Sight>,
) -> (Moments, f64) {
    let (mut pulls, mut evidence) = (Moments::default(), Evidence::default());
    let reach2 = (REACH * sigma).powi(2);
    for (row, p) in query.points.iter().enumerate() {
        let model = model.of_share(sight.map_or(1.0, |sight| sight.shares[0][row]));
        let place = pose.image(p);
        let (mut sum, mut total) = (Vector3::zeros(), 0.0);
        map.near(&place, REACH * sigma, |row| {
            let partner = map.points[row as usize];
            let d2 = (partner - place).norm_squared();
            if d2 > reach2 {
                return;
            }
            let ratio = gaussian(d2, sigma * sigma) / map.density[row as usize];
            sum += partner * ratio;
            total += ratio;
        });
        // Where the map shows nothing a fruit says nothing.
        let likelihood = model.missed(map.support.at(&place)) + model.detection * total;
        evidence.multiply(likelihood);
        if total > 0.0 {
            pulls.add(p, &(sum / total), model.detection * total / likelihood);
        }
    }
    (pulls, evidence.log_odds())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Scale, Similarity};
    use crate::verified::fixture::visits;
    use nalgebra::Rotation3;

    #[test]
    fn a_pose_that_is_off_by_the_width_of_a_gap_is_pulled_into_place() {
        let (query, map) = visits(0.02);
        let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
        let model = Model { sigma: 0.02, detection: 0.3, scale: Scale::Metric, vertical: None, row: None };
        let truth = Similarity { translation: query.centre - map.centre, ..Similarity::identity() };
        let moved = Similarity { translation: truth.translation + Vector3::new(0.04, -0.03, 0.02), ..truth };
        let start = moved.turned(&Vector3::zeros(), &Rotation3::new(Vector3::new(0.02, -0.03, 0.03)));
        let off = |pose: &Similarity| {
            query.points.iter().map(|p| (pose.image(p) - truth.image(p)).norm()).fold(0.0, f64::max)
        };
        let (pose, nats) = pulled(&query, &map, &model, &start, &[0.3, 0.2, 0.15, 0.15]);
        let (_, before) = pulled(&query, &map, &model, &start, &[0.15]);
        assert!(off(&start) > 0.1 && off(&pose) < 0.03, "{} {}", off(&start), off(&pose));
        assert!(nats > before + 50.0, "{nats} {before}");
    }

    #[test]
    fn the_noise_under_which_the_best_of_some_poses_stands_out_most_is_that_of_the_visits() {
        for sigma in [0.02, 0.04, 0.08] {
            let (query, map) = visits(sigma);
            let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
            let model = Model { sigma: 0.02, detection: 0.3, scale: Scale::Metric, vertical: None, row: None };
            let truth = Similarity { translation: query.centre - map.centre, ..Similarity::identity() };
            let aside = |x: f64| Similarity { translation: truth.translation + Vector3::new(x, 0.0, 0.0), ..truth };
            let found = sharpest(&query, &map, &model, &[aside(0.6), truth, aside(-0.9)]);
            assert!((0.6..1.7).contains(&(found / sigma)), "{found} for {sigma}");
        }
    }
}
