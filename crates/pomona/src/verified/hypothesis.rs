//! Poses with the evidence around them, refined from what seeds propose.

use super::landscape::Landscape;
use super::placement::{FIXING, Moments, Placement};
use super::vertical::Vertical;
use crate::geometry::Scale;
use nalgebra::Vector3;

/// Probability that a fruit is seen again, while poses are compared; the pairs estimate their own.
pub(super) const DETECTION: f64 = 0.55;

/// What is assumed of one pair of visits while poses are compared.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Model {
    /// Relative noise per axis in metres of the map.
    pub(crate) sigma: f64,
    /// Probability that a fruit of the query, inside the map's support, has its partner there.
    pub(crate) detection: f64,
    pub(crate) scale: Scale,
    pub(crate) vertical: Option<Vertical>,
}

impl Model {
    /// Likelihood ratio of a fruit at squared distance `d2` from a map fruit being that fruit, against chance at
    /// `density`.
    ///
    /// 1 - p + p N(d; 0, `variance`) / density: missing costs 1 - p, agreement gains what the Gaussian exceeds the
    /// fruits that chance puts there (Lang et al. 2010, eq. for the foreground-background odds).
    #[inline]
    pub(crate) fn met(&self, d2: f64, variance: f64, density: f64) -> f64 {
        1.0 - self.detection + self.detection * gaussian(d2, variance) / density
    }

    /// One least-squares step from `start`, of pairs whose noise is `sigma` and of a vertical that is known.
    pub(crate) fn step(&self, pairs: &Moments, start: &Placement, sigma: f64) -> Option<Placement> {
        let pose = pairs.step(start, self.scale, 0.0)?;
        let Some(vertical) = self.vertical else { return Some(pose) };
        Some(vertical.upheld(&pose, &pairs.centroid(), &(pairs.inertia_under(&pose) / (sigma * sigma))))
    }

    /// Likelihood ratio of a fruit without a partner at a place of `support`; of a fruit of either visit.
    #[inline]
    pub(crate) fn missed(&self, support: f64) -> f64 {
        1.0 - self.detection * support
    }
}

/// Density of an isotropic normal distribution in space at squared distance `d2`, per cubic metre.
#[inline]
pub(crate) fn gaussian(d2: f64, variance: f64) -> f64 {
    const NORM: f64 = 0.063_493_635_934_240_97; // (2 pi)^(-3/2)
    NORM / (variance * variance.sqrt()) * (-0.5 * d2 / variance).exp()
}

/// A product of likelihood ratios. Its logarithm is taken when it leaves the numbers' range and in the end, not of
/// every factor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Evidence {
    product: f64,
    nats: f64,
}

impl Default for Evidence {
    fn default() -> Self {
        Self { product: 1.0, nats: 0.0 }
    }
}

impl Evidence {
    #[inline]
    pub(crate) fn multiply(&mut self, ratio: f64) {
        self.product *= ratio;
        if !(1e-200..1e200).contains(&self.product) {
            *self = Self { product: 1.0, nats: self.log_odds() };
        }
    }

    #[inline]
    pub(crate) fn log_odds(&self) -> f64 {
        self.nats + self.product.ln()
    }
}

/// How many standard deviations a partner may lie away: `P(chi^2_3 > 9)` = 3 %.
pub(crate) const GATE: f64 = 3.0;

/// A pose with the evidence around one place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hypothesis {
    pub(crate) pose: Placement,
    /// Evidence against chance within the place's reach, nats.
    pub(crate) log_odds: f64,
    /// Where the evidence lies, in the centred query.
    pub(crate) place: Vector3<f64>,
    /// Relative noise per axis that the residuals show, metres of the map.
    pub(crate) sigma: f64,
}

/// Buffers of [`refine`], reused between hypotheses.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    region: Vec<u32>,
    partners: Vec<(u32, f64, f64)>,
    owner: Vec<(u32, u32)>,
    stamp: u32,
}

/// Steps of a refinement.
pub(super) const STEPS: usize = 6;

/// Improves a pose on the fruits within `reach` of `place` and weighs their evidence.
pub(crate) fn refine(
    query: &Landscape,
    map: &Landscape,
    start: &Placement,
    place: &Vector3<f64>,
    reach: f64,
    model: &Model,
    scratch: &mut Scratch,
) -> Option<Hypothesis> {
    refine_in(STEPS, query, map, start, (place, reach), model, scratch)
}

/// The same in fewer steps of pairing, of which the last only weighs.
pub(super) fn refine_in(
    steps: usize,
    query: &Landscape,
    map: &Landscape,
    start: &Placement,
    (place, reach): (&Vector3<f64>, f64),
    model: &Model,
    scratch: &mut Scratch,
) -> Option<Hypothesis> {
    scratch.owner.resize(map.len(), (0, 0));
    let region = &mut scratch.region;
    region.clear();
    query.tree.within(&super::nearest::single(place), reach as f32, |row, _| region.push(row));
    region.sort_unstable();
    let mut pose = *start;
    let mut sigma = model.sigma;
    // Before the first step the pose is known as well as a seed gives it: 6 cm at 1 m for 2 cm of noise.
    let (mut freedom, mut inertia, mut centroid) = (0.25, 0.1 * reach * reach, *place);
    let mut answer = None;
    for step in 0..steps {
        let variance_at = |p: &Vector3<f64>| sigma * sigma * (1.0 + freedom + (p - centroid).norm_squared() / inertia);
        pair_up(query, map, &pose, variance_at, scratch);
        let mut moments = Moments::default();
        let (mut evidence, mut residual) = (Evidence::default(), 0.0);
        for (&row, &(partner, d2, variance)) in scratch.region.iter().zip(&scratch.partners) {
            let p = query.points[row as usize];
            if partner == u32::MAX {
                evidence.multiply(model.missed(map.support(&pose.apply(&p))));
                continue;
            }
            let met = model.met(d2, variance, map.density[partner as usize]);
            evidence.multiply(met);
            // Posterior probability that the partner is the fruit and no chance neighbour.
            let weight = 1.0 - (1.0 - model.detection) / met;
            moments.add(&p, &map.points[partner as usize], weight);
            residual += weight * d2;
        }
        if moments.weight < FIXING {
            return answer;
        }
        let mut log_odds = evidence.log_odds();
        if step + 1 == steps {
            log_odds += other_side(query, map, &pose, place, reach, model, scratch);
        }
        answer = Some(Hypothesis { pose, log_odds, place: *place, sigma });
        if step + 1 == steps {
            break;
        }
        pose = model.step(&moments, &pose, sigma)?;
        centroid = moments.centroid();
        freedom = 1.0 / moments.weight;
        inertia = moments.inertia();
        if step >= 2 {
            let freedoms = (3.0 * moments.weight - 6.0).max(0.0);
            sigma = ((PRIOR_FREEDOMS * model.sigma * model.sigma + residual) / (PRIOR_FREEDOMS + freedoms)).sqrt();
        }
    }
    answer
}

/// The other half of the evidence: fruits of the map that the query should have seen, and how many pairs were due.
///
/// With two visits that see a fruit with probability p each, the likelihood ratio of "same trees" to "unrelated" is
/// the product of N(d) p / density over the pairs, of (1 - p) over the fruits of either visit that lack a partner, and
/// exp(p n) for the n fruits of the query inside the overlap: the pairs that unrelated trees would have shown double.
fn other_side(
    query: &Landscape,
    map: &Landscape,
    pose: &Placement,
    place: &Vector3<f64>,
    reach: f64,
    model: &Model,
    scratch: &Scratch,
) -> f64 {
    let due: f64 = scratch.region.iter().map(|&row| map.support(&pose.apply(&query.points[row as usize]))).sum::<f64>()
        * model.detection;
    let mut missing = Evidence::default();
    map.tree.within(&super::nearest::single(&pose.apply(place)), (reach * pose.scale) as f32, |row, _| {
        if scratch.owner[row as usize].0 != scratch.stamp {
            missing.multiply(model.missed(query.support(&pose.apply_inverse(&map.points[row as usize]))));
        }
    });
    due + missing.log_odds()
}

/// Nearest partners of the region's fruits; of several that claim one fruit the nearest keeps it.
fn pair_up(
    query: &Landscape,
    map: &Landscape,
    pose: &Placement,
    variance_at: impl Fn(&Vector3<f64>) -> f64,
    scratch: &mut Scratch,
) {
    scratch.stamp += 1;
    let stamp = scratch.stamp;
    scratch.partners.clear();
    for (at, &row) in scratch.region.iter().enumerate() {
        let p = query.points[row as usize];
        let variance = variance_at(&p);
        let found = map.nearest(&pose.apply(&p), GATE * variance.sqrt());
        let Some((partner, d2)) = found else {
            scratch.partners.push((u32::MAX, 0.0, variance));
            continue;
        };
        let mut entry = (partner, d2, variance);
        let owner = &mut scratch.owner[partner as usize];
        if owner.0 == stamp {
            let rival = &mut scratch.partners[owner.1 as usize];
            if rival.1 <= d2 {
                entry.0 = u32::MAX;
            } else {
                rival.0 = u32::MAX;
                owner.1 = at as u32;
            }
        } else {
            *owner = (stamp, at as u32);
        }
        scratch.partners.push(entry);
    }
}

/// Degrees of freedom of the noise that is expected: they keep few pairs from shrinking the noise to their own fit.
pub(crate) const PRIOR_FREEDOMS: f64 = 1.0;
