"""Covariances of steps (translation, rotation) of a pose T on its right, T exp(x), x in the frame that moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["carried_covariance", "symmetric"]

Array = NDArray[np.float64]


def carried_covariance(other_from_own: Array, covariance: Array) -> Array:
    """Give the covariance of a step of another frame that is fixed to the one that moves, both (6, 6).

    With X = other_from_own, T exp(x) X^-1 = (T X^-1) exp(Ad x), Ad = [[R, [t] R], [0, R]].
    """
    R, t = other_from_own[:3, :3], other_from_own[:3, 3]
    adjoint = np.zeros((6, 6))
    adjoint[:3, :3] = adjoint[3:, 3:] = R
    adjoint[:3, 3:] = np.cross(np.eye(3), t) @ R
    return symmetric(adjoint @ covariance @ adjoint.T)


def symmetric(covariance: Array) -> Array:
    """Give the same without what rounding puts beside the diagonal."""
    return np.asarray(0.5 * (covariance + covariance.T), np.float64)
