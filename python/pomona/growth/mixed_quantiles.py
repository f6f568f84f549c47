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
    level: float, weights: Sequence[float], means: Sequence[Numbers], sigmas: Sequence[Numbers]
) -> Numbers:
    """Return the quantile of a mixture of Gaussians, shaped as each of the means.

    Parameters
    ----------
    level : float
        Between 0 and 1.
    weights : sequence of float
        Of the curves, the sum is 1.
    means, sigmas : sequences of arrays
        One each for a curve, all of one shape; sigmas above 0.
    """
    own = [mean + ndtri(level) * sigma for mean, sigma in zip(means, sigmas, strict=True)]
    # Below the least of them all curves have less than the level, above the largest all have more.
    low, high = np.minimum.reduce(own), np.maximum.reduce(own)
    for _ in range(_HALVINGS if len(own) > 1 else 0):
        middle = 0.5 * (low + high)
        parts = zip(weights, means, sigmas, strict=True)
        is_below = sum(weight * ndtr((middle - mean) / sigma) for weight, mean, sigma in parts) < level
        low, high = np.where(is_below, middle, low), np.where(is_below, high, middle)
    return np.asarray(0.5 * (low + high))
