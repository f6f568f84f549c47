"""What weighted draws say of each number: its mean over equal shares of the probability."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["equal_shares"]

Numbers = NDArray[np.float64]


def equal_shares(drawn: Numbers, weights: Numbers, count: int) -> Numbers:
    """Part the distribution of each number into equal shares, (count, ...), from the least, and give their means.

    They are draws of one weight for means and quantiles of each number, though not of several together; the mean is
    kept exactly.

    Parameters
    ----------
    drawn : (D, ...) float64
    weights : (D,) float64
        Of the draws, above 0.
    count : int
    """
    columns = drawn.reshape(len(drawn), -1)
    order = np.argsort(columns, axis=0, kind="stable")
    sorted_weights = (weights / weights.sum())[order]
    ends = np.vstack([np.zeros(columns.shape[1]), np.cumsum(sorted_weights, axis=0)])
    sums = np.cumsum(sorted_weights * np.take_along_axis(columns, order, axis=0), axis=0)
    sums = np.vstack([np.zeros(columns.shape[1]), sums])
    steps = np.linspace(0.0, 1.0, count + 1)
    until = [np.interp(steps, end, total) for end, total in zip(ends.T, sums.T, strict=True)]
    shares = count * np.diff(np.array(until).T, axis=0)
    return np.asarray(shares.reshape(count, *drawn.shape[1:]))
