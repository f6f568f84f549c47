//! Where in a large map a query may lie: its seeds of the rarest shape, and what they meet.

use super::glance::Glance;
use super::ground::Ground;
use super::shapes::{Scratch, Shape, Shapes, in_steps, rounded};
use super::surroundings::Neighbourhood;
use crate::verified::codes::Code;
use crate::verified::hypothesis::Model;
use crate::verified::landscape::Landscape;
use crate::verified::proposal::Proposer;
use crate::verified::search::{Contender, Effort};
use crate::verified::seeds::{NEAR_TIE, Quad, SHORTEST, Seed, enumerate, near_ties, shuffled};
use rayon::prelude::*;

/// Reach of the code search in standard deviations of one axis: a third less than where the map is small. It holds half of
/// the true seeds that the other holds, and a tenth of the false ones.
const RADIUS: f64 = 1.7;

/// Seeds of a query that are considered, at the most.
const CONSIDERED: usize = 40_000;

/// What a look at an empty part of the space of shapes costs, in candidates.
const LEAST: f32 = 16.0;

/// Looks that are worth a thread of their own.
const SHARE_OF_LOOKS: usize = 16;

/// A labelled seed of the query that may be looked up.
pub(super) struct Look {
    quad: Quad,
    shape: Shape,
    /// Candidates that it is expected to meet.
    expected: f32,
}

/// All that are worth it, of the rarest shape first.
pub(super) fn looks(query: &Landscape, shapes: &Shapes, model: &Model, step: f64) -> Vec<Look> {
    let seeds = enumerate(query, SHORTEST * model.sigma);
    let stride = seeds.len().div_ceil(CONSIDERED).max(1) as u64;
    let considered: Vec<Seed> =
        (0..).zip(seeds).filter(|&(at, _)| shuffled(at).is_multiple_of(stride)).map(|(_, seed)| seed).collect();
    let of_seed = |&(quad, _): &Seed| {
        let mut found = Vec::new();
        near_ties(&query.points, quad, NEAR_TIE * model.sigma, &mut |quad, code: Code| {
            let steps = in_steps(&code, step);
            if let (Some(shape), Some(crowd)) = (rounded(&steps), shapes.crowd(&steps)) {
                found.push(Look { quad, shape, expected: crowd + LEAST });
            }
        });
        found
    };
    let mut looks: Vec<Look> = considered.par_iter().with_min_len(256).flat_map_iter(of_seed).collect();
    looks.par_sort_unstable_by(|a, b| a.expected.total_cmp(&b.expected).then(a.quad.cmp(&b.quad)));
    looks
}

/// How many of the first looks meet as many candidates as `budget`.
pub(super) fn within_budget(looks: &[Look], budget: f32) -> usize {
    let mut spent = 0.0;
    looks
        .iter()
        .take_while(|look| {
            spent += look.expected;
            spent <= budget
        })
        .count()
}

/// Poses that the looks propose and that the fruits around do not contradict.
pub(super) fn proposals(
    query: &Landscape,
    (ground, shapes): (&Ground, &Shapes),
    model: &Model,
    looks: &[Look],
    step: f64,
) -> (Vec<Contender>, Effort) {
    let near_step = shapes.near_step();
    // Twelve numbers less the six of a pose.
    let most = 2.0 * (RADIUS * model.sigma).powi(2);
    let parts: Vec<(Vec<Contender>, Effort)> = looks
        .par_chunks(SHARE_OF_LOOKS)
        .map(|looks| {
            let (mut found, mut effort, mut scratch) = (Vec::new(), Effort::default(), Scratch::default());
            for look in looks {
                effort.codes += 1;
                let Some(proposer) = Proposer::new(query, ground, model, look.quad) else { continue };
                let glance = Glance::new(&proposer, query, model, look.quad, most);
                shapes.near(look.shape, (RADIUS * model.sigma / step) as f32, &mut scratch);
                effort.candidates += scratch.met.len() as u64;
                for (seed, around) in scratch.met.iter().zip(&scratch.around) {
                    if !glance.admits(seed.which(), &Neighbourhood::new(around, near_step)) {
                        continue;
                    }
                    effort.fitted += 1;
                    let Some(target) = shapes.quad(*seed) else { continue };
                    let Some((pose, _)) = proposer.fit(&target) else { continue };
                    let Some(pose) = proposer.upright(pose) else { continue };
                    let log_odds = proposer.first_look(&pose);
                    if log_odds > 0.0 {
                        found.push(Contender { pose, log_odds, place: proposer.centroid, key: (look.quad, target) });
                    }
                }
            }
            (found, effort)
        })
        .collect();
    let effort = parts.iter().fold(Effort::default(), |sum, part| sum + part.1);
    (parts.into_iter().flat_map(|part| part.0).collect(), effort)
}
