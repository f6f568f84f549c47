r"""One fruit out of many sightings: centre and diameter weighted by their covariances.

With sightings x_i of covariance C_i the centre is the minimum of sum_i rho(m_i^2), m_i^2 = (x - x_i)^T C_i^-1 (x -
x_i), rho Cauchy's: x = (sum w_i C_i^-1)^-1 sum w_i C_i^-1 x_i with w_i = 1 / (1 + m_i^2 / 3) (3 is what m_i^2 is on
average). A sighting of the leaf in front is 5 sigma off and counts a ninth. Rays that cross make the long axes of the
C_i cut each other: that is how many poor depths give one good place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["fuse_centres", "fuse_diameters"]

Array = NDArray[np.float64]

ITERATIONS = 10

SHARED = 0.1
"""Part of a sighting's variance that the next one repeats: shape, outline and leaves change little from frame to
frame, so the variance does not fall below this part of a single sighting's, however many there are."""


def fuse_centres(centres: Array, covariances: Array) -> tuple[Array, Array]:
    """Fuse sightings of one fruit.

    Parameters
    ----------
    centres : (V, 3) float64
        In one frame of reference, metres.
    covariances : (V, 3, 3) float64
        Positive definite, square metres.

    Returns
    -------
    centre : (3,) float64
    covariance : (3, 3) float64
        Larger by chi^2 per degree of freedom where the sightings disagree by more than they say.
    """
    information: Array = np.asarray(np.linalg.inv(covariances), np.float64)
    centre: Array = np.asarray(np.median(centres, axis=0), np.float64)
    for _ in range(ITERATIONS):
        weight = 1.0 / (1.0 + _mahalanobis2(centres - centre, information) / 3.0)
        total = np.einsum("v,vij->ij", weight, information)
        centre = np.linalg.solve(total, np.einsum("v,vij,vj->i", weight, information, centres))
    if len(centres) == 1:
        return centre, covariances[0]
    chi2 = float(weight @ _mahalanobis2(centres - centre, information)) / (3.0 * (len(centres) - 1))
    covariance = np.linalg.inv(total) * max(chi2, 1.0) + SHARED * covariances.mean(axis=0)
    return centre, (covariance + covariance.T) / 2


def fuse_diameters(diameters_m: Array, sigmas_m: Array) -> tuple[float, float]:
    """Fuse diameters (V,) with standard deviations (V,) in the same way; give the diameter and its sigma."""
    diameter_m = float(np.median(diameters_m))
    for _ in range(ITERATIONS):
        weight = 1.0 / (sigmas_m**2 * (1.0 + ((diameters_m - diameter_m) / sigmas_m) ** 2))
        diameter_m = float(weight @ diameters_m / weight.sum())
    if len(diameters_m) == 1:
        return diameter_m, float(sigmas_m[0])
    chi2 = float(weight @ (diameters_m - diameter_m) ** 2) / (len(diameters_m) - 1)
    return diameter_m, float(np.sqrt(max(chi2, 1.0) / weight.sum() + SHARED * np.mean(sigmas_m**2)))


def _mahalanobis2(deviations: Array, information: Array) -> Array:
    return np.asarray(np.einsum("vi,vij,vj->v", deviations, information, deviations))
