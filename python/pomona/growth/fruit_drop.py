r"""Which fruits will drop: those that grow at less than half the rate of the fastest (Greene and others 2013).

Rates between two days are noisy, and the fastest of them are the luckiest: to compare each with those says that all
drop. So the true rates are modelled, of two groups: fruits that stay are Gaussian, those of fruits that will drop lie
anywhere below half of the fast rate. What is measured is that, blurred by the noise of two diameters and moved by what
all sizes of a visit share; of a few, one diameter is not the fruit's and the rate says nothing:

$$ p(r) = (1 - q) \left[ \pi\, U(r - c) + (1 - \pi)\, \mathcal N(r; m + c, m^2 v^2 + \nu^2) \right]
   + q\, \mathcal N(r; m + c, B^2) $$

The rate $m$, the spread $v$, the share $\pi$, the noise $\nu$ and what is shared, $c$, each have a prior, and the
probability of each fruit is the mean over their posterior. So it is the prior's share where two days tell nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit, logsumexp, ndtr

from pomona.growth.chance import evenly_spread
from pomona.growth.student_points import student_density, student_points

__all__ = ["LARGEST_FRUITLET_MM", "FruitDrop", "MeasuredRates", "drop_of"]

Numbers = NDArray[np.float64]

LARGEST_FRUITLET_MM = 45.0
"""The rule is one of fruitlets in the weeks after bloom; of what is larger, the drop is over (apples, pears)."""

SLOW = (-0.1, 0.5)
"""Shares of the fast rate, between which fruits drop: below half of it, and they shrink but little."""

SURE_TO, SURENESS = 0.4, 0.9
"""Share of the fast rate to which a rate must be sure, with this probability: at half of it the groups lie in each
other, and where the noise may be large, rates that it scatters look like two groups."""

_FAST_SIGMAS = 1.28
"""The fast rate is that of the ninth of ten fruits that stay: fifteen to twenty of some two hundred, as by hand."""

_OFF = 0.02
"""Share of rates of which one of the two diameters is not the fruit's: one in a hundred sizes is not, see `trust`."""

_FASTEST_MM = 2.0
"""Of a day; no fruitlet grows so fast, and no search begins beyond."""

_MOST_FRUITS = 1000
"""That the five numbers are fitted to."""

# Medians and standard deviations of the logarithms; of the share, of its odds.
_RATE = (0.7, 0.5)
"""Of fruitlets that stay, mm a day."""
_SPREAD = (0.15, 0.5)
"""Of these rates, a share of their mean."""
_ODDS = (0.25, 1.5)
"""Of dropping."""

_STARTS = tuple(product((-1.0, 1.0), (-2.5, 0.0)))
"""Of the search, in standard deviations of the prior: few and many that drop, little and usual noise."""

_DRAWS = 256
"""Around each mode."""

_STEP = 0.05
"""Of the differences that tell the curvature, in standard deviations of the prior."""

_LEAST_CURVATURE = 0.5
"""Of the density of the draws, against the prior's."""

_LEAST_WEIGHT = 1e-5
"""Of a draw: what is believed less adds nothing but time."""


@dataclass(frozen=True, eq=False)
class MeasuredRates:
    """Rates of N fruits between two days, and how they may be off.

    Attributes
    ----------
    mm_per_day : (N,) float64
        NaN where one of the days did not measure the fruit; at least one is known.
    per_mm : (N,) float64
        Standard deviation of each for a millimetre of noise in a single diameter.
    noise_mm : tuple of float
        Usual noise of a diameter, and the standard deviation of its logarithm.
    shared_mm_per_day : float
        Standard deviation of what the scales of the two visits do to all rates.
    off_mm_per_day : float
        Standard deviation of a rate of which one diameter is not the fruit's.
    """

    mm_per_day: Numbers
    per_mm: Numbers
    noise_mm: tuple[float, float]
    shared_mm_per_day: float
    off_mm_per_day: float


@dataclass(frozen=True, eq=False)
class FruitDrop:
    """What the rates say.

    Attributes
    ----------
    probabilities : (N,) float64
        Of dropping; NaN where the rate is not known.
    fast_mm_per_day : float
        Rate of the fastest fruits: without the noise of a diameter, with what the two visits do to all rates.
    share : float
        Of fruits that will drop.
    sigma_mm_per_day : float
        Standard deviation of a rate, the noise of its two diameters: it is at most that with nine tenths.
    wanted_mm_per_day : float
        What that must be at most, so that slow fruits are told from fast ones, with nine tenths too.
    """

    probabilities: Numbers
    fast_mm_per_day: float
    share: float
    sigma_mm_per_day: float
    wanted_mm_per_day: float

    @property
    def is_told(self) -> bool:
        """Whether rates are that sure: else probabilities are hardly those of each fruit."""
        return self.sigma_mm_per_day <= self.wanted_mm_per_day


def drop_of(rates: MeasuredRates) -> FruitDrop:
    """Tell who will drop."""
    known = np.flatnonzero(~np.isnan(rates.mm_per_day))
    # Sums go through rates in their order, whatever the ids are.
    known = known[np.lexsort((rates.per_mm[known], rates.mm_per_day[known]))]
    measured, per_mm = rates.mm_per_day[known], rates.per_mm[known]
    step = -(-len(known) // _MOST_FRUITS)
    posterior = _RatesPosterior(rates, measured[step // 2 :: step], per_mm[step // 2 :: step])
    numbers, weights = _weighed(posterior)
    drops = np.zeros(len(known))
    for number, weight in zip(numbers, weights, strict=True):
        drops += weight * posterior.groups(number).drops(measured, per_mm)
    probabilities = np.full(len(rates.mm_per_day), np.nan)
    probabilities[known] = drops
    told = np.array([posterior.groups(number).told for number in numbers])
    fast, shared, share, _ = (weights @ told).tolist()
    sigma = _quantile(told[:, 3], weights, SURENESS) * float(np.median(per_mm))
    least_fast = _quantile(told[:, 0], weights, 1.0 - SURENESS)
    return FruitDrop(probabilities, fast + shared, share, sigma, SURE_TO * least_fast)


def _quantile(values: Numbers, weights: Numbers, level: float) -> float:
    order = np.argsort(values)
    place = np.searchsorted(np.cumsum(weights[order]), level).clip(max=len(order) - 1)
    return float(values[order[place]])


@dataclass(frozen=True)
class _Groups:
    """The five numbers."""

    rate: float
    spread: float
    share: float
    noise_mm: float
    shared: float
    off: float

    @property
    def fast(self) -> float:
        return self.rate * (1.0 + _FAST_SIGMAS * self.spread)

    @property
    def told(self) -> tuple[float, float, float, float]:
        return self.fast, self.shared, self.share, self.noise_mm

    def densities(self, rates: Numbers, per_mm: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Return densities of rates of fruits that drop and that stay, each with its share, and of none, (N,)."""
        noise = self.noise_mm * per_mm
        slowest, slow = self.fast * SLOW[0], self.fast * SLOW[1]
        away = rates - self.shared
        level = (ndtr((away - slowest) / noise) - ndtr((away - slow) / noise)) / (slow - slowest)
        stays = _gaussian(away - self.rate, np.hypot(self.rate * self.spread, noise))
        none = _gaussian(away - self.rate, np.hypot(self.off, noise))
        # So far out that all would be 0, the rate is none.
        none = np.maximum(none, 1e-300)
        return (1.0 - _OFF) * self.share * level, (1.0 - _OFF) * (1.0 - self.share) * stays, _OFF * none

    def drops(self, rates: Numbers, per_mm: Numbers) -> Numbers:
        """Return the probability of each to drop, (N,)."""
        drops, stays, none = self.densities(rates, per_mm)
        return np.asarray((drops + self.share * none) / (drops + stays + none))


class _RatesPosterior:
    """The logarithm of the posterior over five numbers, in standard deviations of the prior."""

    def __init__(self, rates: MeasuredRates, measured: Numbers, per_mm: Numbers) -> None:
        self._rates, self._measured, self._per_mm = rates, measured, per_mm

    def groups(self, z: Numbers) -> _Groups:
        middles = np.log([_RATE[0], _SPREAD[0], _ODDS[0], self._rates.noise_mm[0]])
        spreads = np.array([_RATE[1], _SPREAD[1], _ODDS[1], self._rates.noise_mm[1]])
        log_rate, log_spread, log_odds, log_noise = middles + spreads * z[:4]
        rate, spread, noise_mm = np.exp([log_rate, log_spread, log_noise]).tolist()
        shared = self._rates.shared_mm_per_day * float(z[4])
        return _Groups(rate, spread, float(expit(log_odds)), noise_mm, shared, self._rates.off_mm_per_day)

    def cost(self, z: Numbers) -> float:
        densities = self.groups(z).densities(self._measured, self._per_mm)
        return 0.5 * float(z @ z) - float(np.log(sum(densities)).sum())

    def starts(self) -> list[Numbers]:
        """Begin at the rate of the faster half."""
        rate = float(np.clip(np.quantile(self._measured, 0.75), _RATE[0] / 4.0, _FASTEST_MM))
        first = np.log(rate / _RATE[0]) / _RATE[1]
        return [np.array([first, 0.0, odds, noise, 0.0]) for odds, noise in _STARTS]


def _weighed(posterior: _RatesPosterior) -> tuple[Numbers, Numbers]:
    """Spread numbers over the posterior around all its modes, and weigh them, (D, 5) and (D,)."""
    modes = [np.asarray(minimize(posterior.cost, start, method="BFGS", tol=1e-2).x) for start in posterior.starts()]
    roots = [_root(posterior, mode) for mode in modes]
    drawn = []
    for place, (mode, root) in enumerate(zip(modes, roots, strict=True)):
        drawn.append(student_points(evenly_spread(f"drop {place}", _DRAWS, len(mode) + 1), mode, root))
    numbers = np.concatenate(drawn)
    densities = [student_density(numbers, mode, root) for mode, root in zip(modes, roots, strict=True)]
    log_weights = -np.array([posterior.cost(z) for z in numbers]) - logsumexp(densities, axis=0)
    weights = np.exp(log_weights - log_weights.max())
    weights = np.minimum(weights, np.sqrt(len(weights)) * weights.mean())
    weights /= weights.sum()
    counts = weights > _LEAST_WEIGHT
    return numbers[counts], weights[counts] / weights[counts].sum()


def _root(posterior: _RatesPosterior, mode: Numbers) -> Numbers:
    """Return the root of the covariance at a mode, by the curvature there."""
    n, steps = len(mode), _STEP * np.eye(len(mode))
    middle = posterior.cost(mode)
    ends = [(posterior.cost(mode + step), posterior.cost(mode - step)) for step in steps]
    curvature = np.diag([above + below - 2.0 * middle for above, below in ends])
    for i, j in combinations(range(n), 2):
        both = posterior.cost(mode + steps[i] + steps[j]) + posterior.cost(mode - steps[i] - steps[j])
        curvature[i, j] = curvature[j, i] = 0.5 * (both + 2.0 * middle - sum(ends[i]) - sum(ends[j]))
    values, axes = np.linalg.eigh(curvature / _STEP**2)
    return np.asarray(np.linalg.cholesky((axes / np.maximum(values, _LEAST_CURVATURE)) @ axes.T), np.float64)


def _gaussian(away: Numbers, sigma: Numbers) -> Numbers:
    return np.asarray(np.exp(-0.5 * (away / sigma) ** 2) / (np.sqrt(2.0 * np.pi) * sigma))
