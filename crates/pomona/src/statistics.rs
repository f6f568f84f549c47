//! Ranks and tails, densities and products of likelihood ratios.

/// Quantile of sorted numbers, linear between ranks.
pub(crate) fn quantile_of_sorted(sorted: &[f64], part: f64) -> f64 {
    let rank = part * (sorted.len() - 1) as f64;
    let below = (rank.floor() as usize).min(sorted.len() - 1);
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (rank - below as f64) * (sorted[above] - sorted[below])
}

/// Median; reorders the numbers. NaN of none.
pub(crate) fn median(numbers: &mut [f64]) -> f64 {
    if numbers.is_empty() {
        return f64::NAN;
    }
    let middle = numbers.len() / 2;
    let is_even = numbers.len().is_multiple_of(2);
    let (below, &mut upper, _) = numbers.select_nth_unstable_by(middle, f64::total_cmp);
    if is_even { f64::midpoint(below.iter().copied().fold(f64::NEG_INFINITY, f64::max), upper) } else { upper }
}

/// The larger of the two middle numbers where there are two; reorders the numbers. 0 of none.
pub(crate) fn upper_median(numbers: &mut [f64]) -> f64 {
    if numbers.is_empty() {
        return 0.0;
    }
    let middle = numbers.len() / 2;
    *numbers.select_nth_unstable_by(middle, f64::total_cmp).1
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

/// Distribution of the length of a vector of three standard normal numbers (Maxwell's).
pub(crate) fn maxwell(x: f64) -> f64 {
    erf(x / std::f64::consts::SQRT_2) - (2.0 / std::f64::consts::PI).sqrt() * x * (-0.5 * x * x).exp()
}

/// Distribution of the length of a normal vector whose variances along its axes are these, to .005 for `(1, 1, 4) / 2`.
///
/// Along each way it is Maxwell's; the mean over all ways is that of the 26 of Lebedev's rule of degree 7, of which those
/// that differ by signs are one here.
pub(crate) fn length_within(x: f64, variances: &[f64; 3]) -> f64 {
    let [a, b, c] = *variances;
    let along = |variance: f64| maxwell(x / variance.sqrt());
    let (axes, edges) = (2.0 / 21.0, 16.0 / 105.0);
    axes * (along(a) + along(b) + along(c))
        + edges * (along(0.5 * (a + b)) + along(0.5 * (a + c)) + along(0.5 * (b + c)))
        + (1.0 - 3.0 * (axes + edges)) * along((a + b + c) / 3.0)
}

/// Error function of x >= 0 to 1.5e-7 (Abramowitz and Stegun 7.1.26).
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let polynomial =
        ((((1.061_405_429 * t - 1.453_152_027) * t + 1.421_413_741) * t - 0.284_496_736) * t + 0.254_829_592) * t;
    1.0 - polynomial * (-x * x).exp()
}

/// Logarithm of the normal distribution function, to 13 digits in both tails.
pub(crate) fn log_normal_cdf(x: f64) -> f64 {
    if x < -NEAR {
        -0.5 * x * x - HALF_LOG_TWO_PI + mills_ratio(-x).ln()
    } else if x <= NEAR {
        (0.5 + central(x)).ln()
    } else {
        (-(-0.5 * x * x - HALF_LOG_TWO_PI).exp() * mills_ratio(x)).ln_1p()
    }
}

/// Where the series gives way to the continued fraction.
const NEAR: f64 = 2.5;
const HALF_LOG_TWO_PI: f64 = 0.918_938_533_204_672_8;

/// Integral of the normal density from 0 to x: phi(x) (x + x^3/3 + x^5/(3 5) + ...), Abramowitz and Stegun 26.2.11.
fn central(x: f64) -> f64 {
    let (mut term, mut sum, mut odd) = (x, x, 1.0);
    while term.abs() > 1e-17 {
        odd += 2.0;
        term *= x * x / odd;
        sum += term;
    }
    sum * (-0.5 * x * x - HALF_LOG_TWO_PI).exp()
}

/// Upper tail over density: 1/(x + 1/(x + 2/(x + 3/(x + ...)))), Abramowitz and Stegun 26.2.14.
fn mills_ratio(x: f64) -> f64 {
    // Sixty levels settle it to 1e-15 from 2.5 on.
    1.0 / (1..=60).rev().fold(x, |below, level| x + f64::from(level) / below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_distribution_has_its_tabulated_values() {
        // log Phi, from a table of 30 digits.
        for (x, expected) in [
            (-40.0, -804.608_442_013_753_8),
            (-10.0, -53.231_285_150_512_47),
            (-3.0, -6.607_726_221_510_349),
            (-2.5, -5.081_648_277_278_691),
            (-1.0, -1.841_021_645_009_264),
            (0.0, -std::f64::consts::LN_2),
            (2.0, -0.023_012_909_328_963_488),
            (3.0, -0.001_350_809_964_748_192_5),
            (9.0, -1.128_588_405_953_832_4e-19),
        ] {
            let found = log_normal_cdf(x);
            assert!((found / expected - 1.0).abs() < 1e-12, "log Phi({x}) = {found}, expected {expected}");
        }
    }

    #[test]
    fn the_distribution_of_lengths_is_that_of_maxwell() {
        assert!(maxwell(0.0).abs() < 1e-6);
        assert!((maxwell(1.538_17) - 0.5).abs() < 1e-4); // its median
        assert!((maxwell(6.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_distribution_of_lengths_of_noise_that_is_long_one_way_is_that_of_its_integral() {
        // P(|x| < r) = integral of N(z; 0, 2) (1 - exp(z^2 - r^2)) over |z| < r, by Simpson's rule.
        let exact = |r: f64| {
            let at =
                |z: f64| (-0.25 * z * z).exp() / (4.0 * std::f64::consts::PI).sqrt() * (1.0 - (z * z - r * r).exp());
            let step = r / 200.0;
            let part = |z: f64| (at(z) + 4.0 * at(z + 0.5 * step) + at(z + step)) * step / 6.0;
            (-200..200).map(|i| part(f64::from(i) * step)).sum::<f64>()
        };
        for r in [0.3, 0.8, 1.2, 1.8, 2.5, 4.0] {
            let (found, exact) = (length_within(r, &[0.5, 2.0, 0.5]), exact(r));
            assert!((found - exact).abs() < 0.005, "{r}: {found} for {exact}");
            assert!((length_within(r, &[1.0; 3]) - maxwell(r)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_product_beyond_the_range_of_numbers_keeps_its_logarithm() {
        let mut product = Evidence::default();
        (0..1000).for_each(|_| product.multiply(1e-3));
        (0..1000).for_each(|_| product.multiply(2e3));
        assert!((product.log_odds() - 1000.0 * 2f64.ln()).abs() < 1e-8);
    }

    #[test]
    fn quantiles_lie_between_ranks() {
        let sorted = [1.0, 2.0, 4.0, 8.0];
        for (part, expected) in [(0.0, 1.0), (1.0, 8.0), (0.5, 3.0), (0.9, 6.8)] {
            assert!((quantile_of_sorted(&sorted, part) - expected).abs() < 1e-12);
        }
        assert!((median(&mut [4.0, 1.0, 8.0, 2.0]) - 3.0).abs() < 1e-12);
        assert!((median(&mut [4.0, 1.0, 8.0]) - 4.0).abs() < 1e-12);
        assert!(median(&mut []).is_nan());
    }
}
