//! One fruit out of many sightings: centre and diameter weighted by their covariances.
//!
//! A sighting says two things that fail apart: a direction, from its box, and a depth, from pictures in which a leaf or
//! the row behind may have been matched instead. So its information J = C^-1 is split along its ray u,
//!
//! ```text
//! J_along = J u u^T J / (u^T J u),    J_across = J - J_along    (J_across u = 0),
//! ```
//!
//! and each part has its own robust loss: the centre is the minimum of
//! `sum_i rho_2(r_i^T J_across r_i) + rho_1(r_i^T J_along r_i)` with `r_i = x - x_i` and Cauchy's
//! `rho_n(m^2) = n log(1 + m^2 / n)`, n the degrees of freedom, what `m^2` is on average. A wrong depth then loses its
//! weight and leaves its ray. Rays that cross make one good place of many poor depths.
//!
//! Leaves make an outline smaller, never larger. So a measured diameter `D_i` is the true one, less a hidden part with
//! an exponential distribution of mean `h_i D_i`, plus Gaussian noise, and the diameter comes from the likelihood
//!
//! ```text
//! L(D) = prod_i 1/(h_i D_i) exp(sigma_i^2 / (2 h_i^2 D_i^2) - (D - D_i) / (h_i D_i))
//!               Phi((D - D_i) / sigma_i - sigma_i / (h_i D_i)).                                     (1)
//! ```

use crate::statistics::{log_normal_cdf, median};
use nalgebra::{Matrix3, Point3, Vector3};

const ITERATIONS: usize = 10;

/// Sightings at whose centres the descent begins, at most. A valley that holds a fifth of the sightings is missed with a
/// probability of 0.8^32, once in a thousand fruits, if they are spread by chance.
const STARTS: usize = 32;

/// Diameters at which the likelihood is summed: a tenth of a millimetre apart for an apple.
const CANDIDATES: usize = 400;

/// Part of the variance of a sighting's centre that the next one repeats: shape, outline and leaves change little from frame to
/// frame, so the variance does not fall below this part of a single sighting's, however many there are.
const SHARED: f64 = 0.1;

/// The same of what a fused diameter errs by, which is all outline: what leaves hide of a fruit they hide in the next frame, too. With a tenth
/// diameters of the recordings of `examples/row` were off by 1.8 standard deviations, with this by 1.0.
const SHARED_OUTLINE: f64 = 0.5;

/// Equation (1) needs a hidden part; this one is as good as none.
const MIN_HIDDEN: f64 = 1e-3;

/// One fruit seen once, in a frame of reference that all sightings share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredCentre {
    /// Metres.
    pub centre: Point3<f64>,
    /// Square metres, positive definite.
    pub covariance: Matrix3<f64>,
    /// Direction in which it was seen, of any length.
    pub ray: Vector3<f64>,
}

/// Fuses sightings of one fruit: centre and covariance.
///
/// The covariance is larger where most sightings disagree by more than they say. None where there are no sightings or a
/// covariance is not positive definite.
pub fn fuse_centres(measured: &[MeasuredCentre]) -> Option<(Point3<f64>, Matrix3<f64>)> {
    let [first, rest @ ..] = measured else { return None };
    if rest.is_empty() {
        return Some((first.centre, first.covariance));
    }
    let sightings: Vec<Split> = measured.iter().map(Split::new).collect::<Option<_>>()?;
    let middle = Point3::from(Vector3::from_fn(|axis, _| {
        median(&mut measured.iter().map(|one| one.centre[axis]).collect::<Vec<_>>())
    }));
    // The cost has a valley for each depth that some sightings agree on: begin at each, keep the deepest. Of many
    // sightings some are enough to have one in every valley that counts.
    let mut best = (f64::INFINITY, middle);
    let every = measured.len().div_ceil(STARTS);
    for start in measured.iter().step_by(every).map(|one| one.centre).chain([middle]) {
        let centre = descend(&sightings, start)?;
        let cost = sightings.iter().map(|one| one.cost(&centre)).sum();
        if cost < best.0 {
            best = (cost, centre);
        }
    }
    let centre = best.1;
    let spread = disagreement(&sightings, &centre);
    let total: Matrix3<f64> = sightings.iter().map(|one| one.weighted(&centre, spread)).sum();
    let covariance = total.cholesky()?.inverse() * (1.0 + SHARED * rest.len() as f64);
    Some((centre, (covariance + covariance.transpose()) / 2.0))
}

/// By how much more than they say the directions and the depths disagree, at least 1.
///
/// Half of either may be wrong, but where the median one is off, all of its kind say too much. So depths that contradict
/// each other leave the place to the directions, and the other way round.
fn disagreement(sightings: &[Split], centre: &Point3<f64>) -> [f64; 2] {
    let squares: Vec<[f64; 2]> = sightings.iter().map(|one| one.squares(centre)).collect();
    let count = sightings.len() as f64;
    std::array::from_fn(|kind| {
        let typical = median(&mut squares.iter().map(|of| of[kind]).collect::<Vec<_>>());
        (typical / MEDIAN_CHI2[kind] * count / (count - 1.0)).max(1.0)
    })
}

/// A sighting with its information split in what it says across its ray and along it.
struct Split {
    centre: Point3<f64>,
    informations: [Matrix3<f64>; 2],
}

/// Degrees of freedom of a sighting across its ray and along it.
const DEGREES: [f64; 2] = [2.0, 1.0];

/// Medians of chi^2 with so many degrees of freedom.
const MEDIAN_CHI2: [f64; 2] = [1.386, 0.455];

/// Information counts as it says.
const AS_IT_SAYS: [f64; 2] = [1.0, 1.0];

impl Split {
    fn new(measured: &MeasuredCentre) -> Option<Self> {
        let whole = measured.covariance.cholesky()?.inverse();
        let pulled = whole * measured.ray;
        let along = pulled * pulled.transpose() / measured.ray.dot(&pulled);
        Some(Self { centre: measured.centre, informations: [whole - along, along] })
    }

    /// Squared Mahalanobis distances across and along.
    fn squares(&self, centre: &Point3<f64>) -> [f64; 2] {
        let off = self.centre - centre;
        self.informations.map(|information| off.dot(&(information * off)))
    }

    fn cost(&self, centre: &Point3<f64>) -> f64 {
        self.squares(centre).iter().zip(DEGREES).map(|(square, degrees)| degrees * (square / degrees).ln_1p()).sum()
    }

    /// Information under the weights that the loss gives it at `centre`, its parts divided by `spread`.
    fn weighted(&self, centre: &Point3<f64>, spread: [f64; 2]) -> Matrix3<f64> {
        let [across, along] = self.squares(centre);
        self.informations[0] / (spread[0] * (1.0 + across / DEGREES[0]))
            + self.informations[1] / (spread[1] * (1.0 + along / DEGREES[1]))
    }
}

/// Sum of the weighted informations, and of what they pull towards.
fn weighted(sightings: &[Split], centre: &Point3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
    sightings.iter().fold((Matrix3::zeros(), Vector3::zeros()), |(total, pull), one| {
        let information = one.weighted(centre, AS_IT_SAYS);
        (total + information, pull + information * one.centre.coords)
    })
}

fn descend(sightings: &[Split], start: Point3<f64>) -> Option<Point3<f64>> {
    (0..ITERATIONS).try_fold(start, |centre, _| {
        let (total, pull) = weighted(sightings, &centre);
        Some(Point3::from(total.cholesky()?.solve(&pull)))
    })
}

/// Diameter of one fruit in one sighting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredDiameter {
    /// As measured.
    pub diameter_m: f64,
    /// Its standard deviation, what leaves hide included.
    pub sigma_m: f64,
    /// Mean part of the diameter that leaves are expected to hide.
    pub hidden: f64,
}

/// Fuses diameters of one fruit by equation (1): mean and standard deviation of the likelihood.
///
/// One sighting alone stays as it is: nothing says how much of it is hidden. None of none, and where one is no length or its standard
/// deviation none.
pub fn fuse_diameters(measured: &[MeasuredDiameter]) -> Option<(f64, f64)> {
    let is_known = |one: &MeasuredDiameter| {
        one.diameter_m.is_finite() && one.diameter_m > 0.0 && one.sigma_m.is_finite() && one.sigma_m >= 0.0
    };
    if !measured.iter().all(is_known) {
        return None;
    }
    let [first, rest @ ..] = measured else { return None };
    if rest.is_empty() {
        return Some((first.diameter_m, first.sigma_m));
    }
    let terms: Vec<Term> = measured.iter().map(Term::new).collect();
    let low = terms.iter().map(|one| one.diameter_m - 3.0 * one.sigma).fold(f64::INFINITY, f64::min).max(0.0);
    let high = terms.iter().map(|one| one.diameter_m + 3.0 * (one.sigma + one.scale)).fold(f64::NEG_INFINITY, f64::max);
    let candidates: Vec<f64> =
        (0..CANDIDATES).map(|k| low + (high - low) * k as f64 / (CANDIDATES - 1) as f64).collect();
    let repeated = |share: f64| 1.0 + share * rest.len() as f64;
    let log_likelihoods: Vec<f64> = candidates
        .iter()
        .map(|&candidate| terms.iter().map(|one| one.log_density(candidate)).sum::<f64>() / repeated(SHARED))
        .collect();
    let highest = log_likelihoods.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = log_likelihoods.iter().map(|one| (one - highest).exp()).collect();
    let total: f64 = weights.iter().sum();
    let mean = weights.iter().zip(&candidates).map(|(weight, one)| weight * one).sum::<f64>() / total;
    let variance =
        weights.iter().zip(&candidates).map(|(weight, one)| weight * (one - mean).powi(2)).sum::<f64>() / total;
    // The mean of a flatter likelihood would lean towards what leaves may hide.
    Some((mean, (variance * repeated(SHARED_OUTLINE) / repeated(SHARED)).sqrt()))
}

/// A sighting in equation (1): Gaussian sigma, and scale of the hidden part.
struct Term {
    diameter_m: f64,
    sigma: f64,
    scale: f64,
}

impl Term {
    fn new(measured: &MeasuredDiameter) -> Self {
        let scale = measured.hidden.max(MIN_HIDDEN) * measured.diameter_m;
        let variance = (measured.sigma_m.powi(2) - scale * scale).max(scale * scale / 100.0);
        Self { diameter_m: measured.diameter_m, sigma: variance.sqrt(), scale }
    }

    /// Up to a constant.
    fn log_density(&self, candidate_m: f64) -> f64 {
        let short = candidate_m - self.diameter_m;
        let ratio = self.sigma / self.scale;
        log_normal_cdf(short / self.sigma - ratio) - short / self.scale + ratio * ratio / 2.0
    }
}

#[cfg(test)]
mod tests;
