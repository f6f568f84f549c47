//! How firmly pairs hold a pose.

use super::seeds::STARS;
use crate::moments::{FIXING, Moments};
use nalgebra::Vector3;

/// Inertia of a fruit that stands for a region without pairs, over the square of how far that reaches.
const INERTIA: f64 = 0.1;

/// How firmly pairs hold a pose: at `p` its variance is that of one pair times [`Footing::looseness`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Footing {
    middle: Vector3<f64>,
    weight: f64,
    inertia: f64,
}

impl Footing {
    /// As well as a seed gives a pose at `place` for a region of this `reach`: 6 cm at 1 m for 2 cm of noise.
    pub(super) fn of_seed(place: &Vector3<f64>, reach: f64) -> Self {
        Self { middle: *place, weight: STARS as f64, inertia: INERTIA * reach * reach }
    }

    /// Of a fit to `moments`, held by as many pairs as `hold` about `centre`, an `edge` away.
    pub(super) fn new(moments: &Moments, hold: f64, edge: f64, centre: Vector3<f64>) -> Self {
        let (middle, inertia) = if moments.weight > FIXING {
            (moments.centroid(), moments.inertia())
        } else {
            (centre, INERTIA * edge * edge)
        };
        Self { middle, weight: moments.weight + hold, inertia: inertia + hold * edge * edge }
    }

    #[inline]
    pub(super) fn looseness(&self, p: &Vector3<f64>) -> f64 {
        1.0 / self.weight + (p - self.middle).norm_squared() / self.inertia
    }

    /// How much a pose that is held by `hold` pairs follows what holds it.
    #[inline]
    pub(super) fn share_held(&self, hold: f64) -> f64 {
        hold / self.weight
    }
}
