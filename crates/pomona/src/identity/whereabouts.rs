//! Where in a large map a visit may lie: a proposal, from what a few stretches of the map look like.
//!
//! To make a map of a hundred thousand fruits ready for queries takes seconds; to make a visit ready takes a twentieth of
//! one. So the map asks and the visit answers: seeds of some fruits of the map, spread over all of it, are looked up
//! among the seeds of the visit, and poses that put fruits next to the seed on fruits of the visit grow outwards. What
//! comes out is no answer: the visit is matched with what lies there.

use crate::cloud::FruitCloud;
use crate::conditioning::Conditioned;
use crate::error::Result;
use crate::geometry::{Scale, Similarity, fit};
use crate::neighbours::tree::{Tree, single};
use crate::random::shuffled;
use crate::verified::{
    COMPANIONS, Landscape, Quad, SEED_SIGMA, SHORTEST, SeedIndex, WITHIN, canonical, frame, near_ties,
};
use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use rayon::prelude::*;

/// Fruits of the map whose seeds are looked up: so many for each visit's worth of the map, and no more than that.
const ANCHORS_EACH: usize = 32;
const ANCHORS: usize = 4096;

/// Seeds of each.
const TURNS: u64 = 2;

/// Fruits next to a seed that are looked at.
const AROUND: usize = 24;

/// Share of them that must meet a fruit of the visit: chance meets one in six. The nearest are asked first, and half of
/// that share of them is enough to go on.
const LEAST_MET: f64 = 0.4;
const FIRST: usize = 12;

/// Seeds whose code has more neighbours in the visit than this say nothing about the place.
const COMMON: usize = 48;

/// Reach of the code search in standard deviations, as the match has it.
const RADIUS: f64 = 2.5;

/// Spacings within which a fruit meets another.
const GATE: f64 = 0.3;

/// Spacings of the first region that a pose is fitted to, and what it grows by at each step.
const REACH: f64 = 3.0;
const GROWS: f64 = 1.6;

/// Rounds in which anchors all over the map are asked, and poses that are grown in each.
const ROUNDS: usize = 8;
const GROWN: usize = 8;

/// Share of the visit's fruits that meet one of the map where no other place has to be looked for: chance gives a sixth.
const ENOUGH: f64 = 0.5;

/// Anchors that are worth a thread of their own.
const SHARE_OF_ANCHORS: usize = 32;

/// A pose that may be that of the visit.
#[derive(Debug, Clone)]
pub struct Whereabouts {
    /// Rigid.
    pub map_from_visit: Similarity,
    /// Fruits of the map that meet one of the visit under it.
    pub n_met: usize,
}

/// Where in the map the visit may lie; `None` where no place stands out from chance.
///
/// # Errors
/// A cloud that is wrong.
pub fn whereabouts(map: &FruitCloud, visit: &FruitCloud) -> Result<Option<Whereabouts>> {
    map.validate()?;
    visit.validate()?;
    let visit = Conditioned::new(visit, Scale::Metric).turned();
    if [map, &visit.cloud].iter().any(|cloud| cloud.len() <= COMPANIONS) {
        return Ok(None);
    }
    // A map is large and asks little of its fruits: what is there twice or lies astray only makes guesses that fail.
    let middle = median_place(&map.positions);
    let places: Vec<_> = map.positions.iter().map(|place| place - middle).collect();
    let search = Search::new(&places, &visit.cloud);
    let anchors = search.anchors();
    let mut best: Option<Whereabouts> = None;
    for round in 0..ROUNDS {
        let some: Vec<u32> = anchors.iter().copied().skip(round).step_by(ROUNDS).collect();
        let mut guesses = search.guesses(&some);
        guesses.sort_by(|a, b| b.n_met.cmp(&a.n_met).then(a.anchor.cmp(&b.anchor)));
        guesses.truncate(GROWN);
        let grown = guesses.par_iter().filter_map(|guess| search.grown(guess)).collect::<Vec<_>>();
        // The first of equal ones, whatever the threads.
        best = best.into_iter().chain(grown).reduce(|best, next| if next.n_met > best.n_met { next } else { best });
        if best.as_ref().is_some_and(|best| best.n_met as f64 > ENOUGH * search.visit.len() as f64) {
            break;
        }
    }
    let outward = Similarity { translation: middle, ..Similarity::identity() };
    Ok(best.map(|found| Whereabouts {
        map_from_visit: outward.compose(&found.map_from_visit).compose(&visit.outward().inverse()),
        ..found
    }))
}

/// The median of each coordinate, which no stray moves: single precision is for what is near it.
fn median_place(places: &[Point3<f64>]) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let mut along: Vec<f64> = places.iter().map(|place| place[axis]).collect();
        *along.select_nth_unstable_by(places.len() / 2, f64::total_cmp).1
    })
}

/// A pose from one seed.
struct Guess {
    map_from_visit: Similarity,
    n_met: usize,
    /// Row of the fruit of the map that it is from.
    anchor: u32,
}

struct Search<'a> {
    map: &'a [Point3<f64>],
    tree: Tree,
    visit: Landscape,
    seeds: SeedIndex,
    sigma: f64,
}

impl<'a> Search<'a> {
    fn new(map: &'a [Point3<f64>], visit: &FruitCloud) -> Self {
        let points: Vec<_> = map.iter().map(|point| single(&point.coords)).collect();
        let visit = Landscape::new(visit);
        let sigma = SEED_SIGMA * visit.spacing;
        let seeds = SeedIndex::new(&visit, Scale::Metric, SHORTEST * sigma);
        Self { map, tree: Tree::new(&points), visit, seeds, sigma }
    }

    /// Fruits all over the map.
    fn anchors(&self) -> Vec<u32> {
        let wanted = (ANCHORS_EACH * self.map.len() / self.visit.len()).clamp(ANCHORS_EACH, ANCHORS);
        let stride = self.map.len().div_ceil(wanted) as u64;
        (0..self.map.len() as u32).filter(|&row| shuffled(u64::from(row)).is_multiple_of(stride)).collect()
    }

    /// Poses of the seeds of anchors.
    fn guesses(&self, anchors: &[u32]) -> Vec<Guess> {
        anchors.par_iter().with_min_len(SHARE_OF_ANCHORS).flat_map_iter(|&anchor| self.guesses_at(anchor)).collect()
    }

    fn guesses_at(&self, anchor: u32) -> Vec<Guess> {
        let mut near = Vec::new();
        self.tree.nearest(&single(&self.map[anchor as usize].coords), AROUND + 1, &mut near);
        let around: Vec<Vector3<f64>> = near.iter().map(|&(row, _)| self.map[row as usize].coords).collect();
        let (mut runs, mut hits, mut guesses) = (Vec::new(), Vec::new(), Vec::new());
        for turn in 0..TURNS {
            let Some((quad, code)) = canonical(&around, set_of(anchor, turn)) else { continue };
            if f64::from(code[0]) < SHORTEST * self.sigma {
                continue;
            }
            near_ties(&around, quad, WITHIN * self.sigma, &mut |quad, code| {
                hits.clear();
                self.seeds.codes.within(&code, (RADIUS * self.sigma) as f32, &mut runs, |hit| hits.push(hit));
                if let Some(axes) = frame(&quad.map(|row| around[row as usize])).filter(|_| hits.len() <= COMMON) {
                    guesses.extend(hits.iter().filter_map(|&hit| self.guess(anchor, &around, quad, &axes, hit)));
                }
            });
        }
        guesses
    }

    /// The pose that lays a seed of the visit on one of the map, if enough of the fruits around it agree.
    fn guess(
        &self,
        anchor: u32,
        around: &[Vector3<f64>],
        quad: Quad,
        axes: &[Vector3<f64>; 3],
        hit: u32,
    ) -> Option<Guess> {
        let seen = self.seeds.quads[hit as usize];
        let rotation = Matrix3::from_columns(axes)
            * Matrix3::from_columns(&frame(&seen.map(|row| self.visit.points[row as usize]))?).transpose();
        let middle = |points: &[Vector3<f64>], quad: Quad| {
            quad.iter().map(|&row| points[row as usize]).sum::<Vector3<f64>>() / 4.0
        };
        let translation = middle(around, quad) - rotation * middle(&self.visit.points, seen);
        let map_from_visit = Similarity::rigid(Rotation3::from_matrix_unchecked(rotation), translation);
        let visit_from_map = map_from_visit.inverse();
        let n_met = |places: &[Vector3<f64>]| {
            places.iter().filter(|place| self.partner(&visit_from_map, place).is_some()).count()
        };
        let (first, rest) = around.split_at(FIRST.min(around.len()));
        let n_first = n_met(first);
        // Four of them are the seed, which meets itself.
        if ((n_first - n_first.min(4)) as f64) < 0.5 * LEAST_MET * first.len() as f64 {
            return None;
        }
        let n_met = n_first + n_met(rest);
        (n_met as f64 >= LEAST_MET * around.len() as f64).then_some(Guess { map_from_visit, n_met, anchor })
    }

    /// The fruit of the visit that a place in the map meets.
    fn partner(&self, visit_from_map: &Similarity, place: &Vector3<f64>) -> Option<u32> {
        let place = visit_from_map.apply(&Point3::from(*place)).coords;
        self.visit.nearest(&place, GATE * self.visit.spacing).map(|(row, _)| row)
    }

    /// The pose fitted to more and more of the map around the anchor, while enough of it agrees.
    fn grown(&self, guess: &Guess) -> Option<Whereabouts> {
        let middle = single(&self.map[guess.anchor as usize].coords);
        let extent = 2.0 * self.visit.points.iter().fold(0.0f64, |far, point| far.max(point.norm()));
        let (mut pose, mut reach, mut n_met) = (guess.map_from_visit, REACH * self.visit.spacing, 0);
        loop {
            let visit_from_map = pose.inverse();
            let (mut source, mut target) = (Vec::new(), Vec::new());
            self.tree.within(&middle, reach as f32, |row, _| {
                let place = self.map[row as usize];
                if let Some(partner) = self.partner(&visit_from_map, &place.coords) {
                    source.push(Point3::from(self.visit.points[partner as usize]));
                    target.push(place);
                }
            });
            if source.len() <= n_met / 2 {
                return None;
            }
            n_met = source.len();
            pose = fit(&source, &target, None, Scale::Metric)?;
            if reach > extent {
                let centre = Similarity { translation: -self.visit.centre, ..Similarity::identity() };
                return Some(Whereabouts { map_from_visit: pose.compose(&centre), n_met });
            }
            reach *= GROWS;
        }
    }
}

/// Places of a fruit and three companions among the fruit and its neighbours, another set each turn.
fn set_of(anchor: u32, turn: u64) -> Quad {
    let mut companions: Vec<u32> = (1..=COMPANIONS as u32).collect();
    companions.sort_by_key(|&at| shuffled(u64::from(anchor) << 16 | turn << 8 | u64::from(at)));
    [0, companions[0], companions[1], companions[2]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wood of fruits; a visit sees three of four of those in a stretch of it, 1 cm off, turned and moved.
    fn wood() -> Vec<Point3<f64>> {
        let place = |key: u64| (shuffled(key) >> 11) as f64 / (1u64 << 53) as f64;
        (0..6000).map(|i| Point3::new(60.0 * place(3 * i), place(3 * i + 1), 3.0 * place(3 * i + 2))).collect()
    }

    fn visit_to(wood: &[Point3<f64>], map_from_visit: &Similarity) -> Vec<Point3<f64>> {
        let visit_from_map = map_from_visit.inverse();
        let seen = wood.iter().enumerate().filter(|(i, p)| i % 4 != 0 && (20.0..26.0).contains(&p.x));
        seen.map(|(i, p)| visit_from_map.apply(p) + Vector3::new(0.01, -0.01, 0.01) * ((i % 3) as f64 - 1.0)).collect()
    }

    #[test]
    fn a_stretch_is_found_where_it_lies() {
        let pose = Similarity::rigid(Rotation3::new(Vector3::new(0.3, -1.1, 2.0)), Vector3::new(4.0, -7.0, 1.0));
        let map = wood();
        let visit = visit_to(&map, &pose);
        let found = whereabouts(&FruitCloud::from_positions(map), &FruitCloud::from_positions(visit.clone()));
        let found = found.expect("valid").expect("it is there");
        assert!(found.n_met as f64 > 0.9 * visit.len() as f64);
        assert!(visit.iter().all(|p| (found.map_from_visit.apply(p) - pose.apply(p)).norm() < 0.05));
    }

    #[test]
    fn few_fruits_lie_nowhere() {
        let few = FruitCloud::from_positions(wood()[..5].to_vec());
        assert!(whereabouts(&few, &few).expect("valid").is_none());
    }
}
