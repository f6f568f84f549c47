r"""Which fruits will drop: those that grow at less than half the rate of the fastest (Greene and others 2013).

Rates between two days are noisy, so each fruit gets a probability instead of a verdict: rates of fruits that stay are
Gaussian, those of fruits that will drop lie anywhere below half of the fast rate, both widened by the noise of two
diameters; how many there are of each follows from all fruits together (expectation-maximisation).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["LARGEST_FRUITLET_MM", "FruitDrop", "drop_of"]

LARGEST_FRUITLET_MM = 45.0
"""The rule is one of fruitlets in the weeks after bloom; of what is larger, the drop is over (apples, pears)."""

SLOW_SHARE = 0.5
"""Of the fast rate, below which fruits drop."""

_FAST_SIGMAS = 1.28
"""The fast rate is that of the ninth of ten fruits that stay: fifteen to twenty of some two hundred, as by hand."""

_ROUNDS = 200
_SHARES = (0.005, 0.95)
"""Least and most fruits that are thought to drop, so that neither kind ever dies out."""


@dataclass(frozen=True, eq=False)
class FruitDrop:
    """What the rates say.

    Attributes
    ----------
    probabilities : (N,) float64
        Of dropping; NaN where the rate is not known.
    fast_mm_per_day : float
        Rate of the fastest fruits.
    share : float
        Of fruits that will drop.
    """

    probabilities: NDArray[np.float64]
    fast_mm_per_day: float
    share: float


def drop_of(rates_mm_per_day: NDArray[np.float64], noise_mm_per_day: float) -> FruitDrop:
    """Tell who will drop.

    Parameters
    ----------
    rates_mm_per_day : (N,) float64
        Between two days, NaN where one was not measured; at least one is known.
    noise_mm_per_day : float
        Standard deviation of a rate that comes of its two diameters alone.
    """
    known = ~np.isnan(rates_mm_per_day)
    rates = rates_mm_per_day[known]
    middle, spread, share = float(np.quantile(rates, 0.75)), max(float(rates.std()) / 2, noise_mm_per_day), 0.1
    for _ in range(_ROUNDS):
        drops = _responsibilities(rates, middle, spread, noise_mm_per_day, share)
        stays = 1.0 - drops
        middle = float((stays @ rates) / stays.sum())
        spread = max(float(np.sqrt(stays @ (rates - middle) ** 2 / stays.sum())), noise_mm_per_day)
        share = float(np.clip(drops.mean(), *_SHARES))
    probabilities = np.full(len(known), np.nan)
    probabilities[known] = _responsibilities(rates, middle, spread, noise_mm_per_day, share)
    return FruitDrop(probabilities, _fast(middle, spread, noise_mm_per_day), share)


def _fast(middle: float, spread: float, noise: float) -> float:
    return max(middle + _FAST_SIGMAS * float(np.sqrt(spread**2 - noise**2)), 0.0)


def _responsibilities(
    rates: NDArray[np.float64], middle: float, spread: float, noise: float, share: float
) -> NDArray[np.float64]:
    """Probability of dropping of each rate: a level density of slow rates blurred by the noise, against a Gaussian."""
    from scipy.stats import norm

    slow = max(SLOW_SHARE * _fast(middle, spread, noise), 1e-6)
    dropping = share * (norm.cdf(rates / noise) - norm.cdf((rates - slow) / noise)) / slow
    staying = (1.0 - share) * norm.pdf(rates, middle, spread)
    # Slower than nothing and far from all that stay: the level density has run out there, the verdict has not.
    dropping = np.where(rates < 0.0, np.maximum(dropping, share / slow * norm.cdf(0.0)), dropping)
    return np.asarray(dropping / np.maximum(dropping + staying, 1e-300))
