//! Where in a large map a query may lie: its seeds that most likely meet their own at the least cost, and what they meet.

use super::glance::Glance;
use super::ground::Ground;
use super::seed_blocks::Anchored;
use super::shapes::{Scratch, Shape, Shapes, in_steps, rounded};
use super::surroundings::Neighbourhood;
use crate::neighbours::code_grid::Code;
use crate::random::shuffled;
use crate::verified::contender::Contender;
use crate::verified::hypothesis::Model;
use crate::verified::landscape::Landscape;
use crate::verified::proposal::{Effort, Proposer, Terrain};
use crate::verified::seeds::{Quad, SHORTEST, Seed, WITHIN, enumerate, near_ties};
use rayon::prelude::*;

/// Reach of the code search in standard deviations of one axis: a third less than where the map is small. It holds half of
/// the true seeds that the other holds, and a tenth of the false ones.
const RADIUS: f64 = 1.7;

/// Nearest neighbours of a fruit of the query among which its seeds are: three more than the map has. Between two fruits that both
/// visits show hang others that only one does.
const ASKED: usize = 13;

/// Seeds of a query that are considered, at the most.
const CONSIDERED: usize = 40_000;

/// What a look costs, in candidates, besides those that it meets.
const LEAST: f32 = 20.0;

/// Seeds in a cell that a count of none stands for: those beside it on two axes are not counted.
const UNSEEN: f32 = 0.05;

/// True seeds that a look of a query in the map meets, over its [`worth`]: what drawn visits met in a million fruits; frames
/// met half as many, because at their rim they show other neighbours than the map.
const MET: f32 = 2e-7;

/// True seeds that a query would have met where the search gives up: of a frame half as many. Were all of it in the map and they
/// independent, none would be met with a probability of exp(-24); of one that shares a fifth with the map exp(-5), less than 1 %.
const ENOUGH: f32 = 48.0;

/// Looks that are worth a thread of their own.
const SHARE_OF_LOOKS: usize = 16;

/// A labelled seed of the query that may be looked up.
pub(super) struct Look {
    quad: Quad,
    shape: Shape,
    /// What it costs, in candidates.
    cost: f32,
    /// True seeds that it meets, on average.
    hope: f32,
}

/// A candidate that a glance did not drop.
struct Glanced {
    evidence: f32,
    /// Which of the looks met it.
    look: u32,
    seed: Anchored,
}

impl Look {
    fn price(&self) -> f32 {
        self.cost / self.hope
    }
}

/// The looks that are worth it, of the least price first.
pub(super) fn looks(query: &Landscape, shapes: &Shapes, model: &Model, step: f64) -> Vec<Look> {
    let seeds = enumerate(query, ASKED, SHORTEST * model.sigma);
    let stride = seeds.len().div_ceil(CONSIDERED).max(1) as u64;
    let considered: Vec<Seed> =
        (0..).zip(seeds).filter(|&(at, _)| shuffled(at).is_multiple_of(stride)).map(|(_, seed)| seed).collect();
    let reach = shapes.reach(reach_in(shapes, model));
    let of_seed = |&(quad, _): &Seed| {
        let (mut found, mut labelings) = (Vec::new(), 0.0f32);
        near_ties(&query.points, quad, WITHIN * model.sigma, &mut |quad, code: Code| {
            labelings += 1.0;
            let steps = in_steps(&code, step);
            if let (Some(shape), Some(crowd)) = (rounded(&steps), shapes.crowd(&steps)) {
                let hope = MET * worth(f32::from(shape[0]), crowd);
                found.push(Look { quad, shape, cost: reach * crowd + LEAST, hope });
            }
        });
        let unsure = labelings * labelings.sqrt();
        found.into_iter().map(move |look| Look { hope: look.hope / unsure, ..look })
    };
    let mut looks: Vec<Look> = considered.par_iter().with_min_len(256).flat_map_iter(of_seed).collect();
    looks.par_sort_unstable_by(|a, b| a.price().total_cmp(&b.price()).then(a.quad.cmp(&b.quad)));
    looks.truncate(first_of(&looks, ENOUGH, |look| look.hope));
    looks
}

/// Reach of the code search in steps.
fn reach_in(shapes: &Shapes, model: &Model) -> f32 {
    (RADIUS * model.sigma / shapes.step()) as f32
}

/// How likely a look is to meet its true seed, up to a factor, by the length of the seed in steps and by how many seeds of the
/// map share its cell; of several labelings of a seed each has less than its share.
///
/// Where the map has no seed there is not the right one either. A short seed is of rare shape because a fruit of it is false
/// or far off, a long one because most are. The powers were fitted to 370 true seeds among 400,000 looks of drawn visits and
/// frames in a million fruits; by this order visits meet the first after a twentieth of the candidates that the order of
/// rarity alone takes, frames after half of them.
fn worth(length: f32, crowd: f32) -> f32 {
    length * length * (crowd + UNSEEN).powf(0.4)
}

/// How many of the first looks cost no more than `budget` together.
pub(super) fn within_budget(looks: &[Look], budget: f32) -> usize {
    first_of(looks, budget, |look| look.cost)
}

/// How many of the first have no more than `most` together.
fn first_of(looks: &[Look], most: f32, amount: impl Fn(&Look) -> f32) -> usize {
    let sums = looks.iter().scan(0.0, |sum, look| {
        *sum += amount(look);
        Some(*sum)
    });
    sums.take_while(|&sum| sum <= most).count()
}

/// Poses that the looks propose and that the fruits around do not contradict: of `most` candidates, the best at a glance.
pub(super) fn proposals(
    query: &Landscape,
    (ground, shapes): (&Ground, &Shapes),
    model: &Model,
    looks: &[Look],
    most: usize,
) -> (Vec<Contender>, Effort) {
    let (mut glanced, met) = glanced(query, (ground, shapes), model, looks);
    let order = |one: &Glanced| (one.look, one.seed);
    if glanced.len() > most {
        let best = |a: &Glanced, b: &Glanced| b.evidence.total_cmp(&a.evidence).then(order(a).cmp(&order(b)));
        glanced.select_nth_unstable_by(most, best);
        glanced.truncate(most);
    }
    glanced.par_sort_unstable_by_key(order);
    let of_look = |some: &[Glanced]| {
        let quad = looks[some[0].look as usize].quad;
        let proposer = Proposer::new(query, ground, model, quad);
        let proposed = |one: &Glanced| {
            let (proposer, target) = (proposer.as_ref()?, shapes.quad(one.seed)?);
            let pose = proposer.upright(proposer.fit(target.map(|row| ground.place(row)))?.0)?;
            let log_odds = proposer.first_look(&pose);
            (log_odds > 0.0).then_some(Contender { pose, log_odds, place: proposer.centroid, key: (quad, target) })
        };
        some.iter().filter_map(proposed).collect::<Vec<_>>()
    };
    let found = glanced.par_chunk_by(|a, b| a.look == b.look).flat_map_iter(of_look).collect();
    let fitted = glanced.len() as u64;
    (found, Effort { codes: looks.len() as u64, candidates: met, fitted, ..Effort::default() })
}

/// What the looks meet and a glance does not drop, and how many they meet.
fn glanced(
    query: &Landscape,
    (ground, shapes): (&Ground, &Shapes),
    model: &Model,
    looks: &[Look],
) -> (Vec<Glanced>, u64) {
    let near_step = shapes.near_step();
    let radius = reach_in(shapes, model);
    // Twelve numbers less the six of a pose.
    let most = 2.0 * (RADIUS * model.sigma).powi(2);
    let of_some = |(share, looks): (usize, &[Look])| {
        let (mut found, mut met, mut scratch) = (Vec::new(), 0, Scratch::default());
        for (at, look) in looks.iter().enumerate() {
            let Some(proposer) = Proposer::new(query, ground, model, look.quad) else { continue };
            let glance = Glance::new(&proposer, query, model, look.quad, most);
            shapes.near(look.shape, radius, &mut scratch);
            met += scratch.met.len() as u64;
            let look = (share * SHARE_OF_LOOKS + at) as u32;
            found.extend(scratch.met.iter().zip(&scratch.around).filter_map(|(&seed, around)| {
                let evidence = glance.evidence(seed.which(), &Neighbourhood::new(around, near_step))? as f32;
                Some(Glanced { evidence, look, seed })
            }));
        }
        (found, met)
    };
    let parts: Vec<(Vec<Glanced>, u64)> = looks.par_chunks(SHARE_OF_LOOKS).enumerate().map(of_some).collect();
    let met = parts.iter().map(|part| part.1).sum();
    (parts.into_iter().flat_map(|part| part.0).collect(), met)
}
