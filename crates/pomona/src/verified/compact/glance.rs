//! A glance at a candidate: do the fruits next to the one that it belongs to contradict it?
//!
//! It asks what the first look asks ([`crate::verified::proposal`]), with the same end, but only of what is written down with
//! that fruit: beyond, nothing is known and nothing said.

use super::surroundings::Neighbourhood;
use crate::verified::hypothesis::{GATE, Model};
use crate::verified::landscape::Landscape;
use crate::verified::proposal::{HOPELESS, Proposer, Terrain};
use crate::verified::seeds::{Quad, STARS};
use nalgebra::Vector3;

/// Fruits of the query that are looked for, those nearest to the one that lies on the fruit of the map.
const BESIDE: usize = 16;

/// A seed of the query with what is looked for beside each of its fruits.
pub(super) struct Glance<'a, M> {
    proposer: &'a Proposer<'a, M>,
    model: &'a Model,
    seed: [Beside; STARS],
    beside: [Vec<Beside>; STARS],
    /// Sum of the squared residuals that four fruits may have, square metres.
    most: f64,
}

/// A fruit of the query: where it is, and the variance of where a pose puts it.
struct Beside {
    place: Vector3<f64>,
    variance: f64,
    gate: f64,
}

impl<'a, M: Terrain> Glance<'a, M> {
    pub(super) fn new(
        proposer: &'a Proposer<'a, M>,
        query: &Landscape,
        model: &'a Model,
        quad: Quad,
        most: f64,
    ) -> Self {
        let fruit = |&row: &u32| {
            let place = query.points[row as usize];
            let variance = proposer.variance(&place);
            Beside { place, variance, gate: GATE * variance.sqrt() }
        };
        let others = |row: u32| query.neighbours(row as usize).iter().filter(|&row| !quad.contains(row)).take(BESIDE);
        let beside = quad.map(|row| others(row).map(fruit).collect());
        Self { proposer, model, seed: quad.map(|row| fruit(&row)), beside, most }
    }

    /// What speaks for a seed of the map, by the numbers of its fruits in a neighbourhood, as a likelihood ratio; `None` where
    /// what hangs there contradicts it.
    #[inline]
    pub(super) fn evidence(&self, which: [usize; STARS], near: &Neighbourhood) -> Option<f64> {
        let mut fruits = [Vector3::zeros(); STARS];
        for (fruit, number) in fruits.iter_mut().zip(which) {
            // Where a fruit is too far away to be written down nothing is known: it has to be looked at.
            let Some(place) = near.place(number) else { return Some(f64::INFINITY) };
            *fruit = place;
        }
        let fitted = self.proposer.fit(fruits).filter(|(_, residual)| *residual <= self.most);
        let pose = fitted.and_then(|(pose, _)| self.proposer.upright(pose))?;
        let anchor = which.iter().position(|&number| number == 0).unwrap_or_default();
        let mut around = 1.0;
        for beside in &self.beside[anchor] {
            let place = pose.image(&beside.place);
            if place.norm() + beside.gate <= near.radius {
                around *= self.ratio(beside, near.nearest(&place), near.density);
            }
            if around < HOPELESS {
                return None;
            }
        }
        let apart = |(one, fruit): (&Beside, &Vector3<f64>)| {
            self.ratio(one, (pose.image(&one.place) - fruit).norm_squared(), near.density)
        };
        Some(around * self.seed.iter().zip(&fruits).map(apart).product::<f64>())
    }

    /// What a fruit whose nearest partner lies at this squared distance says, as a likelihood ratio.
    #[inline]
    fn ratio(&self, fruit: &Beside, d2: f64, density: f64) -> f64 {
        if d2 <= fruit.gate * fruit.gate { self.model.met(d2, fruit.variance, density) } else { self.model.missed(1.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Scale;
    use crate::verified::compact::surroundings::{NEAR, packed, step_of};
    use crate::verified::fixture::visits;
    use crate::verified::hypothesis::DETECTION;
    use crate::verified::seeds::longest;

    /// A seed by the numbers of its fruits in the neighbourhood of its first, and that neighbourhood; what hangs there beside
    /// the seed is taken from next to `other`.
    fn written_down(map: &Landscape, quad: Quad, other: u32) -> Option<([usize; STARS], Neighbourhood)> {
        let offsets = |row: u32| {
            let own = map.points[row as usize];
            map.neighbours(row as usize).iter().map(move |&near| map.points[near as usize] - own)
        };
        let near = map.neighbours(quad[0] as usize);
        let mut which = [0; STARS];
        for (number, row) in which.iter_mut().zip(quad).skip(1) {
            *number = near.iter().take(NEAR).position(|&other| other == row)? + 1;
        }
        let both = near.iter().zip(offsets(quad[0]).zip(offsets(other)));
        let mixed = both.map(|(row, (own, theirs))| if quad.contains(row) { own } else { theirs });
        let step = step_of(map.spacing);
        Some((which, Neighbourhood::new(&packed(mixed, map.density[quad[0] as usize], step), step)))
    }

    #[test]
    fn true_candidates_pass_and_most_others_do_not() {
        let (query, map) = visits(0.02);
        let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
        let model = Model { sigma: 0.02, detection: DETECTION, scale: Scale::Metric, vertical: None, row: None };
        let shift = query.centre - map.centre;
        let partner = |row: u32| map.nearest(&(query.points[row as usize] + shift), 0.05).map(|(row, _)| row);
        let (mut tried, mut passed, mut dropped) = (0, 0, 0);
        for (quad, _) in longest(&query, 20_000, f32::INFINITY) {
            let [Some(a), Some(b), Some(c), Some(d)] = quad.map(partner) else { continue };
            let there = [a, b, c, d];
            let elsewhere = (a + map.len() as u32 / 2) % map.len() as u32;
            let [Some(same), Some(other)] = [a, elsewhere].map(|row| written_down(&map, there, row)) else { continue };
            let Some(proposer) = Proposer::new(&query, &map, &model, quad) else { continue };
            let glance = Glance::new(&proposer, &query, &model, quad, 0.01);
            tried += 1;
            passed += u32::from(glance.evidence(same.0, &same.1).is_some());
            dropped += u32::from(glance.evidence(other.0, &other.1).is_none());
        }
        assert!(tried > 100, "{tried}");
        assert!(5 * passed >= 4 * tried, "{passed} of {tried}");
        assert!(2 * dropped >= tried, "{dropped} of {tried}");
    }
}
