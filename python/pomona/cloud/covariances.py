"""Which matrices can be covariances of places."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["are_covariances"]

BEYOND_ROUNDING = 1e-12
"""A minor of a matrix of entries up to 1 above this is above zero."""


def are_covariances(matrices: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which of finite matrices, (N, 3, 3), are symmetric positive semi-definite but for rounding, (N,)."""
    # Scaled first: squares of what is finite need not be.
    largest = np.abs(matrices).max(axis=(1, 2), keepdims=True, initial=0.0)
    scaled = np.divide(matrices, largest, out=np.zeros_like(matrices), where=largest > 0)
    tolerance = 1e-9 * np.linalg.norm(scaled, axis=(1, 2))
    right = np.abs(scaled - scaled.transpose(0, 2, 1)).max(axis=(1, 2), initial=0.0) <= tolerance
    doubtful = np.flatnonzero(~_are_surely_positive(scaled))
    right[doubtful] &= np.linalg.eigvalsh(scaled[doubtful]).min(axis=1, initial=np.inf) >= -tolerance[doubtful]
    return np.asarray(right)


def _are_surely_positive(scaled: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which matrices, symmetric with entries up to 1, have leading minors above zero by more than rounding.

    Those are positive definite; the eigenvalues of the others are asked for, at ten times the cost.
    """
    a, b, c, d, e, f = (scaled[:, row, column] for row, column in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    second = a * b - d * d
    third = c * second - a * f * f - b * e * e + 2.0 * d * e * f
    return np.asarray((a > BEYOND_ROUNDING) & (second > BEYOND_ROUNDING) & (third > BEYOND_ROUNDING))
