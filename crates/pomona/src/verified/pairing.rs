//! The last word on every fruit: one-to-one pairs with calibrated probabilities.

use super::chance::Companions;
use super::direction::longest;
use super::patches::{Landing, Patchwork};
use crate::beliefs::Edge;
use crate::neighbours::others::SHARE_OF_ROWS;
use nalgebra::{Cholesky, Matrix3, U3, Vector3};
use rayon::prelude::*;

/// Standard deviations that an edge reaches: as far as a branch may have moved for itself. Five lose three of a hundred
/// pairs of a real tree that bent under its load (`benchmarks season`, nothing hidden).
pub(super) const GATE: f64 = 7.0;

/// Share of the fruits that moved otherwise than their neighbours, and how many times wider they scatter.
///
/// Real residuals have tails that no normal distribution has: a branch broke loose, a depth was measured on a leaf. A
/// pair far off is believed only where nothing else is near.
const LOOSE: (f64, f64) = (0.01, 3.0);

/// Fruits of a visit that tell half of how those around a fruit are spread.
const FEW: f64 = 100.0;

/// Pairs less likely than this against both being alone are left out.
const LEAST_RATIO: f64 = 1e-3;

impl Patchwork<'_> {
    /// Pairs with their likelihood ratios, where each fruit of the query is seen again with the probability that `shares` says and
    /// one of the map with the probability that `back` says, `size` the likelihood ratio of two diameters.
    ///
    /// A fruit of the query without a partner is new with the density of new fruits at its place, one of the map was missed. Every
    /// pair thus weighs `p N(d) / (1 - p) / (1 - q) / density of others` against leaving both alone.
    pub(super) fn edges(
        &self,
        meetings: &[Meeting],
        [shares, back]: [&[f64]; 2],
        size: &(impl Fn(u32, u32) -> f64 + Sync),
    ) -> Vec<Edge> {
        let Self { query, map, .. } = *self;
        let ([same, another], bearings) = (self.companions(), map.bearings());
        let edge = |meeting: &Meeting| {
            let Meeting { query: row, map: partner, offset, distance, density, support } = *meeting;
            let seen = shares[row as usize] * support;
            let crowding = 0.5 * (query.crowding[row as usize] + map.crowding[partner as usize]);
            // As many others as the two visits laid on each other have, where the map shows as much as it does here.
            let replaced = self.replaced[row as usize];
            let around = (1.0 - replaced) * same.density(distance) + replaced * another.density(distance);
            let others = (around * bearings.towards(&offset)).max(map.floor) * crowding * self.strangers * support;
            let missed = 1.0 - back[partner as usize];
            meeting.edge(seen * density / ((1.0 - seen) * missed * others.max(map.floor)) * size(row, partner))
        };
        meetings.par_iter().with_min_len(SHARE_OF_ROWS).filter_map(edge).collect()
    }
}

/// A fruit of the map near the place where one of the query is expected.
#[derive(Debug, Clone, Copy)]
pub(super) struct Meeting {
    pub(super) query: u32,
    pub(super) map: u32,
    /// From where the fruit is expected to the partner, and how far that is.
    offset: Vector3<f64>,
    pub(super) distance: f64,
    /// Of the partner's place, were both one fruit, per cubic metre.
    pub(super) density: f64,
    /// How surely the map's visit would have shown a fruit there.
    pub(super) support: f64,
}

impl Meeting {
    /// The pair with its likelihood ratio, where that is worth being looked at.
    pub(super) fn edge(&self, ratio: f64) -> Option<Edge> {
        (ratio > LEAST_RATIO).then_some(Edge { query: self.query, map: self.map, ratio })
    }
}

impl Patchwork<'_> {
    /// Fruits of the map that chance puts around a fruit: as many as the map shows around its own, spread as both visits show them; and those
    /// of another tree in its place.
    ///
    /// Noise blurs what a visit shows around its own fruits by twice its own variance, and what the other shows around them by that of
    /// both, which lies midway. Where one shows fewer, its fruits were thinned or picked and are spread otherwise than those of the map;
    /// and a few fruits tell no spread, so each counts as much as any other.
    pub(super) fn companions(&self) -> [Companions; 2] {
        let Self { query, map, pose, .. } = self;
        let [here, there] = [query.len(), map.len()].map(|fruits| fruits.max(1) as f64);
        let each_alike = here / (here + there);
        let midway = 0.5 * map.companions.as_many_as(&query.companions, pose.scale);
        let told = 1.0 / (1.0 + FEW * (1.0 / here + 1.0 / there));
        let same = map.companions.spread_as(&query.companions, pose.scale, each_alike + told * (midway - each_alike));
        let another = same.keeping_no_distance().or_denser(&map.moved().all);
        [same, another]
    }

    /// What `kept` makes of every meeting within so many standard deviations, by rows of the query.
    pub(super) fn meetings<T: Send>(&self, gate: f64, kept: impl Fn(&Meeting) -> Option<T> + Sync) -> Vec<T> {
        let of = |row: usize| self.meetings_of(row, gate).into_iter().filter_map(|meeting| kept(&meeting));
        (0..self.predictions.len()).into_par_iter().with_min_len(SHARE_OF_ROWS).flat_map_iter(of).collect()
    }

    fn meetings_of(&self, row: usize, gate: f64) -> Vec<Meeting> {
        let (map, pose) = (self.map, &self.pose);
        let Some(Landing { place, variance }) = self.predictions[row] else { return Vec::new() };
        let (support, shape) = (self.shown(row, &place), self.direction.without(row));
        let common = Spread::new(&(shape * variance), variance);
        let own = self.query.covariances.as_ref().map(|all| pose.image_of_covariance(&all[row]));
        // No axis has more than the trace, three times the mean.
        let widest = if own.is_some() && map.covariances.is_some() { 3.0 } else { longest(&shape) };
        let reach = gate * (widest * variance).sqrt();
        // Cells of the grid have more than what is within reach, which no covariance brings within the gate.
        let mut partners = Vec::new();
        map.near(&place, reach, |partner| {
            if (map.points[partner as usize] - place).norm_squared() <= reach * reach {
                partners.push(partner);
            }
        });
        // Two cells of the grid may share a bucket, which then is visited twice.
        partners.sort_unstable();
        partners.dedup();
        let meeting = |partner: u32| {
            let offset = map.points[partner as usize] - place;
            let told = own.zip(map.covariances.as_ref()).map(|(own, all)| own + all[partner as usize]);
            let own = told.map(|told| Spread::new(&(as_told(&told, variance, &shape) * variance), variance));
            let (mahalanobis2, density) = own.as_ref().unwrap_or(&common).at(&offset);
            let distance = offset.norm();
            (mahalanobis2 <= gate * gate).then_some(Meeting {
                query: row as u32,
                map: partner,
                offset,
                distance,
                density,
                support,
            })
        };
        partners.into_iter().filter_map(meeting).collect()
    }
}

/// Shape of the noise of a pair whose own covariances come to `told`, square metres; `shape` is that of all.
///
/// The residuals of all pairs say how large the noise is, the fruits' own covariances which way it points: stereo
/// centroids are long along the viewing ray. A tenth of the variance stays as that of all pairs, for what the recording
/// does not know of (sag, growth).
fn as_told(told: &Matrix3<f64>, variance: f64, shape: &Matrix3<f64>) -> Matrix3<f64> {
    let mean = told.trace() / 3.0;
    if mean <= 0.0 {
        return *shape;
    }
    let share = (mean / variance).min(0.9);
    told * (share / mean) + shape * (1.0 - share)
}

/// Normal noise with the tails of [`LOOSE`].
struct Spread {
    factor: Cholesky<f64, U3>,
    /// Density at the middle of a normal distribution, per cubic metre.
    peak: f64,
}

impl Spread {
    /// Of a covariance, or of as much round noise where it is none.
    fn new(covariance: &Matrix3<f64>, variance: f64) -> Self {
        let factor = covariance.cholesky().unwrap_or_else(|| {
            let round = Matrix3::from_diagonal_element(variance.sqrt());
            Cholesky::pack_dirty(round)
        });
        let peak = (2.0 * std::f64::consts::PI).powf(-1.5) / factor.l_dirty().diagonal().product();
        Self { factor, peak }
    }

    /// Squared Mahalanobis distance of a residual, and its density per cubic metre.
    fn at(&self, offset: &Vector3<f64>) -> (f64, f64) {
        let (share, width) = LOOSE;
        let d2 = offset.dot(&self.factor.solve(offset));
        let loose = (-0.5 * d2 / (width * width)).exp() / width.powi(3);
        (d2, self.peak * ((1.0 - share) * (-0.5 * d2).exp() + share * loose))
    }
}
