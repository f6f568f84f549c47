//! A closer look at a contender: its pose refined on the places in the index, and what the fruits around its seed say then.
//!
//! It does what [`crate::verified::hypothesis::refined`] does, without the map's side of the evidence and without
//! what only a prepared part of the map knows: to prepare one takes longer than hundreds of closer looks.

use crate::geometry::Similarity;
use crate::moments::{FIXING, Moments};
use crate::statistics::Evidence;
use crate::verified::contender::{Contender, by_evidence};
use crate::verified::footing::Footing;
use crate::verified::hypothesis::{GATE, Model};
use crate::verified::landscape::Landscape;
use crate::verified::proposal::Terrain;
use crate::verified::search::REACH;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Steps of a refinement: a turned start is at its end then.
const STEPS: usize = 5;

/// Turn either way about each axis of the starts beside the own one, radians.
///
/// The noise of four fruits turns a seed by 5 degrees on average and by 15 at times. Fruits a metre away then meet
/// their neighbours' partners, and the refinement can stay there.
const TURN_RAD: f64 = 0.2;

/// One in so many, the best, is started turned too.
const TURNED: usize = 4;

/// Contenders that are worth a thread of their own.
const SHARE: usize = 4;

/// The contenders as they are on a closer look, most evidence first.
pub(super) fn closer<M: Terrain + Sync>(
    query: &Landscape,
    map: &M,
    model: &Model,
    contenders: &[Contender],
) -> Vec<Contender> {
    let from = |one: &Contender, starts: &mut dyn Iterator<Item = Similarity>| {
        let region = Region::around(query, one.place);
        let refined = starts.filter_map(|start| region.refined(map, model, start));
        let best = refined.max_by(|a, b| a.1.total_cmp(&b.1));
        best.map(|(pose, log_odds)| Contender { pose, log_odds, ..*one })
    };
    let straight = |one: &Contender| from(one, &mut std::iter::once(one.pose));
    let mut closer: Vec<Contender> = contenders.par_iter().with_min_len(SHARE).filter_map(straight).collect();
    closer.sort_unstable_by(by_evidence);
    let turned = |one: &mut Contender| {
        let more = from(one, &mut one.pose.turned_either_way(&one.place, TURN_RAD).into_iter());
        *one = more.filter(|more| more.log_odds > one.log_odds).unwrap_or(*one);
    };
    let best = contenders.len().div_ceil(TURNED).min(closer.len());
    closer[..best].par_iter_mut().with_min_len(SHARE).for_each(turned);
    closer.sort_unstable_by(by_evidence);
    closer
}

/// The fruits of the query around a seed.
struct Region {
    place: Vector3<f64>,
    fruits: Vec<Vector3<f64>>,
    reach: f64,
}

impl Region {
    fn around(query: &Landscape, place: Vector3<f64>) -> Self {
        let reach = REACH * query.spacing;
        let rows = query.within(&place, reach);
        Self { place, fruits: rows.iter().map(|&row| query.points[row as usize]).collect(), reach }
    }

    /// A pose improved on the fruits, and their evidence.
    fn refined(&self, map: &impl Terrain, model: &Model, start: Similarity) -> Option<(Similarity, f64)> {
        let mut pose = start;
        let mut footing = Footing::of_seed(&self.place, self.reach);
        for _ in 0..STEPS {
            let (moments, _) = self.paired(map, model, &pose, &footing);
            if moments.weight < FIXING {
                return None;
            }
            pose = moments.step(&pose, model.scale, 0.0)?;
            footing = Footing::new(&moments, 0.0, self.reach, self.place);
        }
        Some((pose, self.paired(map, model, &pose, &footing).1))
    }

    /// Sums over the pairs of a pose, and the evidence of all fruits.
    fn paired(&self, map: &impl Terrain, model: &Model, pose: &Similarity, footing: &Footing) -> (Moments, f64) {
        let (mut moments, mut evidence) = (Moments::default(), Evidence::default());
        for p in &self.fruits {
            let variance = model.sigma * model.sigma * (1.0 + footing.looseness(p));
            let Some((row, d2)) = map.nearest(&pose.image(p), GATE * variance.sqrt()) else {
                evidence.multiply(model.missed(1.0));
                continue;
            };
            let met = model.met(d2, variance, map.density(row));
            evidence.multiply(met);
            moments.add(p, &map.place(row), model.no_stranger(met));
        }
        (moments, evidence.log_odds())
    }
}
