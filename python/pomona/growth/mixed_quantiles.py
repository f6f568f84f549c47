"""Quantiles of what several curves say together, each by a Gaussian of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

__all__ = ["mixed_quantile"]

Numbers = NDArray[np.float64]

_HALVINGS = 20
"""Of the span between the curves' own quantiles: to a millionth of it."""


def mixed_quantile(
    level: float, weights: Sequence[float | Numbers], means: Sequence[Numbers], sigmas: Sequence[Numbers]
) -> Numbers:
    """Return the quantile of a mixture of Gaussians, shaped as each of the means.

    Parameters
    ----------
    level : float
        Between 0 and 1.
    weights : sequence of float or array
        Of the curves, the sum is 1 everywhere; where one is 0, its mean and sigma are not asked, and may be NaN.
    means, sigmas : sequences of arrays
        One each for a curve, all of one shape; sigmas above 0.
    """
    own = [mean + ndtri(level) * sigma for mean, sigma in zip(means, sigmas, strict=True)]
    # Below the least of them all curves have less than the level, above the largest all have more.
    low, high = np.fmin.reduce(own), np.fmax.reduce(own)
    for _ in range(_HALVINGS if len(own) > 1 else 0):
        middle = 0.5 * (low + high)
        parts = zip(weights, means, sigmas, strict=True)
        is_below = sum(_below(middle, *part) for part in parts) < level
        low, high = np.where(is_below, middle, low), np.where(is_below, high, middle)
    return np.asarray(0.5 * (low + high))


def _below(limit: Numbers, weight: float | Numbers, mean: Numbers, sigma: Numbers) -> Numbers:
    return np.where(np.asarray(weight) > 0.0, weight * ndtr((limit - mean) / sigma), 0.0)
