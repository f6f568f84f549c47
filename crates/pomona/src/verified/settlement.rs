//! The last word on patches and noise, before pairs are reported.
//!
//! Growth goes by nearest partners. Where fruits crowd, the nearest is often a stranger, and a patch that is fitted to
//! strangers meets them ever closer: the noise comes out small, the pairs surer than they are. So what growth found is
//! settled once more, in turns:
//!
//! 1. Every fruit is predicted without its own partner (leave-one-out).
//! 2. The noise comes from distances, nobody said to be who ([`super::scatter`]).
//! 3. Every pair gets its probability ([`super::pairing`]); their sum says the share of the next turn, and how they lie off
//!    which way the noise points ([`super::direction`]).
//! 4. Patches are fitted to the mean partners under these probabilities, each held to its surroundings and these to
//!    the common pose as firmly as the clouds show that they move together.

use super::axes::row_axes;
use super::cut::Cell;
use super::direction::Direction;
use super::evidence::evidence;
use super::footing::Footing;
use super::growth::{Growth, HOLD};
use super::hypothesis::{DETECTION, SHARES, TURNS};
use super::moved::MovedPose;
use super::overlap::Overlap;
use super::pairing::{GATE, Meeting};
use super::patches::{ALL, NEXT, Patchwork};
use super::scatter::{GIVEN, GUESSED, KnownNoise, Scatter, scatter};
use super::shares::{of_either, of_places};
use super::size::Cue;
use crate::beliefs::Beliefs;
use nalgebra::Vector3;
use std::sync::OnceLock;

/// A prediction loses at most this share of its fit when its own partner is left out.
const MAX_LEVERAGE: f64 = 0.8;

/// Evidence, nats, by which noise that is long in the depth of a row must exceed noise that is a sphere, where constellations find
/// the row: one pair of visits in twenty is so, beforehand. Rows that only lie along rows are as often seen from opposite sides.
pub(super) const SELDOM: f64 = 3.0;

/// Variance in the depth of a row over the mean, from which on length is asked about. Below it, long noise had less evidence in all
/// searches that were looked into; without it half of all rows would be settled twice.
const TOLD: f64 = 1.1;

/// The overlap as it stands in the end.
pub(crate) struct Settled {
    pub(crate) overlap: Overlap,
    /// Pairs by their probabilities.
    pub(crate) beliefs: Beliefs,
    /// What speaks for the pose when every fruit is predicted without its own partner, nats ([`super::evidence`]).
    pub(crate) evidence: f64,
    /// Which way the noise points.
    pub(super) direction: Direction,
    /// What it has where it is moved, once that is asked for.
    pub(super) moved: OnceLock<Vec<MovedPose>>,
}

struct Settlement<'a> {
    patches: Patchwork<'a>,
    expected: KnownNoise,
    /// Fruits of the map near the predictions.
    meetings: Vec<Meeting>,
    /// Probability that a fruit of the query is there where the map could have shown it, as the pairs around it show it.
    shares: Vec<f64>,
    /// How surely the query would have shown each fruit of the map, and the probability that it did.
    there: Vec<f64>,
    back: Vec<f64>,
    /// Pairs that hold the patches to their surroundings, and these to the common pose.
    holds: [f64; 2],
}

/// Settles what `growth` found; `noise_m` is the relative noise where it is known.
///
/// It is settled with noise that is a sphere and, in a row, with noise that is long in its depth; what says more counts. Where
/// constellations find the row, that is asked only if pairs lie off more in depth than else.
pub(crate) fn settle(growth: &Growth, noise_m: Option<f64>) -> Settled {
    let laid = growth.patches.model.row;
    let under = |direction: Direction| settle_together(&[(growth, direction)], noise_m).swap_remove(0);
    let sphere = under(Direction::default());
    let least = sphere.evidence + if laid.is_some() { 0.0 } else { SELDOM };
    let row = laid.or_else(|| row_axes(growth.patches.map).filter(|axes| sphere.direction.in_depth(axes) > TOLD));
    let long = row.map(|axes| under(Direction::long_in_depth(&axes)));
    long.filter(|long| long.evidence > least).unwrap_or(sphere)
}

/// Settles parts of one row, each under noise of an expected direction: a fruit has one partner at most in all of them.
pub(super) fn settle_together(parts: &[(&Growth, Direction)], noise_m: Option<f64>) -> Vec<Settled> {
    let mut settling: Vec<Settlement> =
        parts.iter().map(|(growth, direction)| Settlement::new(growth, noise_m, direction)).collect();
    let mut beliefs = paired(&mut settling, None);
    for _ in 0..TURNS {
        let clouds = [settling[0].patches.query, settling[0].patches.map];
        let cue = Cue::new(clouds, beliefs.iter().flat_map(Beliefs::links));
        for (part, beliefs) in settling.iter_mut().zip(&beliefs) {
            part.turn(beliefs);
        }
        beliefs = paired(&mut settling, cue.as_ref());
    }
    let settled = |((part, beliefs), (growth, _)): ((Settlement, Beliefs), &(&Growth, Direction))| {
        let evidence = evidence(&part.patches);
        let Patchwork { pose, sigma, predictions, direction, .. } = part.patches;
        let overlap = Overlap { pose, sigma, predictions, ..growth.overlap() };
        Settled { overlap, beliefs, evidence, direction, moved: OnceLock::new() }
    };
    settling.into_iter().zip(beliefs).zip(parts).map(settled).collect()
}

/// Predictions, noise and pairs of all parts under the poses as they are fitted now.
fn paired(parts: &mut [Settlement], cue: Option<&Cue>) -> Vec<Beliefs> {
    let size = |query: u32, map: u32| cue.map_or(1.0, |cue| cue.ratio(query, map));
    let edges = |part: &mut Settlement| {
        part.predict();
        part.measure();
        part.meetings = part.patches.meetings(GATE, |meeting| Some(*meeting));
        part.patches.edges(&part.meetings, [&part.shares, &part.back], &size)
    };
    let lists: Vec<_> = parts.iter_mut().map(edges).collect();
    let Patchwork { query, map, .. } = parts[0].patches;
    Beliefs::together(&lists, query.len(), map.len())
}

impl<'a> Settlement<'a> {
    fn new(growth: &Growth<'a>, noise_m: Option<f64>, direction: &Direction) -> Self {
        let expected = match noise_m.or(growth.sharpest) {
            Some(sigma) => KnownNoise { sigma, width: GIVEN },
            None => KnownNoise { sigma: growth.patches.model.sigma, width: GUESSED },
        };
        let mut patches = Patchwork { direction: direction.clone(), ..growth.patches.clone() };
        patches.cells.iter_mut().for_each(|cell| cell.at_rest = false);
        // Trees that were replaced would be taken for noise from the first turn on.
        let grown: Vec<f64> = patches.targets.iter().map(|target| target.map_or(0.0, |(_, weight)| weight)).collect();
        patches.replaced = of_places(patches.query, &grown, &patches.due()).replaced;
        let shares = vec![DETECTION; patches.query.len()];
        let there: Vec<f64> = (0..patches.map.len()).map(|row| patches.looked_at(row)).collect();
        let [_, of_map] = of_either(DETECTION, [patches.due().iter().sum(), there.iter().sum()]);
        let back = there.iter().map(|there| of_map * there).collect();
        Self { patches, expected, meetings: Vec::new(), shares, there, back, holds: [HOLD; 2] }
    }

    /// What the pairs say of shares, noise and patches.
    fn turn(&mut self, beliefs: &Beliefs) {
        self.recount(beliefs);
        self.patches.direction = self.patches.direction.seen(&self.patches, beliefs);
        self.refit(beliefs);
    }

    /// Where each fruit should lie by all partners but its own, and how surely.
    fn predict(&mut self) {
        let [hold, hold_around] = self.holds;
        let footings = |patches: &Patchwork, cell: &Cell| {
            [patches.footing(cell, NEXT, hold), patches.footing(cell, ALL, hold_around)]
        };
        let landing = |patches: &Patchwork, row: usize, [near, wide]: [Footing; 2]| {
            let p = &patches.query.points[row];
            // The patch follows its surroundings in the measure in which it is held to them.
            let looseness = near.looseness(p) + near.share_held(hold) * wide.looseness(p);
            let mut landing = patches.landing(row, looseness, 1.0);
            if let Some((residual, weight)) = patches.left_over[row] {
                // Of a linear fit: the residual without the own partner is r / (1 - h), h the leverage.
                let leverage = (weight * looseness).min(MAX_LEVERAGE);
                landing.place -= residual * (leverage / (1.0 - leverage));
            }
            landing
        };
        self.patches.predict(footings, landing);
    }

    /// Noise and strangers from the distances; the predictions' variances follow.
    fn measure(&mut self) {
        let Scatter { sigma: found, strangers } = scatter(&self.patches, self.expected);
        self.patches.strangers = strangers;
        let both = self.patches.predictions.iter().zip(&self.patches.targets);
        let (sum, weights) = both
            .filter_map(|(prediction, target)| Some((prediction.as_ref()?.variance, (*target)?.1)))
            .fold((0.0, 0.0), |sum, (variance, weight)| (sum.0 + weight * variance, sum.1 + weight));
        if weights > 0.0 {
            let stretch = found * found * weights / sum;
            self.patches.sigma *= stretch.sqrt();
            self.patches.predictions.iter_mut().flatten().for_each(|prediction| prediction.variance *= stretch);
        }
    }

    /// The shares as the pairs show them: a step of expectation and maximisation a turn.
    ///
    /// The distances of all fruits together do not know who hangs alone and who in a crowd; the pairs do, and err
    /// less. All the way they would take too little where fruits crowd within the noise.
    fn recount(&mut self, beliefs: &Beliefs) {
        let Patchwork { query, map, .. } = self.patches;
        let mut found = [vec![0.0; query.len()], vec![0.0; map.len()]];
        for (edge, probability) in beliefs.links() {
            found[0][edge.query as usize] += probability;
            found[1][edge.map as usize] += probability;
        }
        let stands: Vec<f64> = self.patches.other_trees(&self.meetings).iter().map(|other| 1.0 - other).collect();
        let standing = |all: &[f64]| all.iter().zip(&stands).map(|(one, stands)| one * stands).collect::<Vec<f64>>();
        let places = of_places(query, &standing(&found[0]), &standing(&self.patches.due()));
        let least = |share: &f64| share.max(SHARES.0);
        self.shares = standing(&places.shares).iter().map(least).collect();
        let replaced = places.replaced.iter().zip(&stands).map(|(replaced, stands)| 1.0 - stands * (1.0 - replaced));
        self.patches.replaced = replaced.collect();
        self.back = of_places(map, &found[1], &self.there).shares;
        self.back.iter_mut().zip(&self.there).for_each(|(share, there)| *share *= there);
    }

    /// Common pose, surroundings and patches from the mean partners.
    fn refit(&mut self, beliefs: &Beliefs) {
        self.follow(beliefs);
        self.patches.fit_as_one();
        self.patches.stiffen();
        self.holds = self.patches.bend(Patchwork::firmness);
        self.patches.look();
        self.patches.share();
    }

    /// Mean partners by the probabilities.
    fn follow(&mut self, beliefs: &Beliefs) {
        let mut sums = vec![(Vector3::zeros(), 0.0); self.patches.query.len()];
        for (edge, probability) in beliefs.links() {
            let sum = &mut sums[edge.query as usize];
            sum.0 += self.patches.map.points[edge.map as usize] * probability;
            sum.1 += probability;
        }
        let mean = |(sum, weight): (Vector3<f64>, f64)| (weight > 0.0).then(|| (sum / weight, weight));
        self.patches.targets = sums.into_iter().map(mean).collect();
        self.patches.sum_up();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Scale, Similarity};
    use crate::verified::fixture::visits_of;
    use crate::verified::growth::grow;
    use crate::verified::hypothesis::{Hypothesis, Model};
    use crate::verified::landscape::Landscape;

    /// How much noise that is long in depth says more than a sphere, nats; how much more is settled for, and the noise; of some fifty
    /// pairs of a row that is laid along the map, or found by constellations.
    fn settled(noise: [f64; 3], laid: bool) -> [f64; 3] {
        let (mut query, map) = visits_of(&Vector3::from(noise));
        // Many pairs show by themselves which way noise is long.
        query.positions.retain(|p| p.x > 3.0);
        let [query, map] = [query, map].map(|cloud| Landscape::new(&cloud));
        let axes = row_axes(&map).expect("a box of 4 x 2 x 1 m is a row");
        let pose = Similarity { translation: query.centre - map.centre, ..Similarity::identity() };
        let row = laid.then_some(axes);
        let model = Model { sigma: 0.02, detection: DETECTION, scale: Scale::Metric, vertical: None, row };
        let seed = Hypothesis { pose, log_odds: 0.0, place: Vector3::zeros(), sigma: 0.02 };
        let mut growth = grow(&query, &map, &seed, &model);
        growth.reach_all();
        let [sphere, long] = [Direction::default(), Direction::long_in_depth(&axes)]
            .map(|direction| settle_together(&[(&growth, direction)], None)[0].evidence);
        let Settled { evidence, overlap, .. } = settle(&growth, None);
        [long - sphere, evidence - sphere, overlap.sigma]
    }

    #[test]
    fn noise_of_rows_laid_along_rows_is_long_in_depth_where_that_says_more() {
        let [more, kept, sigma] = settled([0.02, 0.02, 0.04], true);
        let mean = 0.02 * 2f64.sqrt();
        assert!(
            more > 0.0 && (kept - more).abs() < 1e-9 && (sigma / mean - 1.0).abs() < 0.15,
            "{more} {kept} {sigma} {mean}"
        );
        let [more, kept, sigma] = settled([0.02; 3], true);
        assert!(more < 0.0 && kept.abs() < 1e-9 && (sigma / 0.02 - 1.0).abs() < 0.15, "{more} {kept} {sigma}");
    }

    #[test]
    fn noise_of_rows_that_constellations_find_is_a_sphere_unless_much_speaks_against_it() {
        let [more, kept, _] = settled([0.02, 0.02, 0.04], false);
        assert!(more < SELDOM && kept.abs() < 1e-9, "{more} {kept}");
        let [more, kept, _] = settled([0.02, 0.02, 0.06], false);
        assert!(more > SELDOM && (kept - more).abs() < 1e-9, "{more} {kept}");
    }
}
