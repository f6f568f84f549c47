"""Points of a multivariate t, by which posteriors are drawn around their modes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import gammaincinv, gammaln, ndtri

__all__ = ["student_density", "student_points"]

Numbers = NDArray[np.float64]

_TAILS = 5.0
"""Degrees of freedom: its tails reach beyond the posterior's."""


def student_points(even: Numbers, middle: Numbers, root: Numbers) -> Numbers:
    """Turn points in the unit cube, (D, n + 1), into ones of a t with a middle, (n,), and the root of a covariance."""
    n = len(middle)
    stretch = np.sqrt(0.5 * _TAILS / gammaincinv(0.5 * _TAILS, even[:, n]))
    return np.asarray(middle + (ndtri(even[:, :n]) * stretch[:, None]) @ root.T)


def student_density(points: Numbers, middle: Numbers, root: Numbers) -> Numbers:
    """Return the logarithm of its density at points (D, n), where the root is a lower triangle."""
    n = len(middle)
    away = solve_triangular(root, (points - middle).T, lower=True)
    constant = gammaln((_TAILS + n) / 2) - gammaln(_TAILS / 2) - n / 2 * np.log(_TAILS * np.pi)
    constant -= np.log(np.diag(root)).sum()
    return np.asarray(constant - (_TAILS + n) / 2 * np.log1p((away**2).sum(axis=0) / _TAILS))
