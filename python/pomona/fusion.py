r"""One fruit out of many sightings: centre and diameter weighted by their covariances.

With sightings x_i of covariance C_i the centre is the minimum of sum_i rho(m_i^2), m_i^2 = (x - x_i)^T C_i^-1 (x -
x_i), rho Cauchy's: x = (sum w_i C_i^-1)^-1 sum w_i C_i^-1 x_i with w_i = 1 / (1 + m_i^2 / 3) (3 is what m_i^2 is on
average). A sighting of the leaf in front is 5 sigma off and counts a ninth. Rays that cross make the long axes of the
C_i cut each other: that is how many poor depths give one good place.

Leaves make an outline smaller, never larger. So a measured diameter D_i is the true one, less a hidden part with an
exponential distribution of mean h_i D_i, plus Gaussian noise, and the diameter comes from the likelihood

    L(D) = prod_i 1/(h_i D_i) exp(sigma_i^2 / (2 h_i^2 D_i^2) - (D - D_i) / (h_i D_i))
                  Phi((D - D_i) / sigma_i - sigma_i / (h_i D_i)).                                     (1)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["fuse_centres", "fuse_diameters"]

Array = NDArray[np.float64]

ITERATIONS = 10

CANDIDATES = 400
"""Diameters at which the likelihood is summed: a tenth of a millimetre apart for an apple."""

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


def fuse_diameters(diameters_m: Array, sigmas_m: Array, hidden: Array) -> tuple[float, float]:
    """Fuse diameters of one fruit by equation (1).

    One sighting alone stays as it is: nothing says how much of it is hidden.

    Parameters
    ----------
    diameters_m : (V,) float64
        As the sightings measured them.
    sigmas_m : (V,) float64
        Their standard deviations, what leaves hide included.
    hidden : (V,) float64
        Mean part of the diameter that leaves are expected to hide.

    Returns
    -------
    diameter_m, sigma_m : float
        Mean and standard deviation of the likelihood.
    """
    from scipy.special import log_ndtr

    if len(diameters_m) == 1:
        return float(diameters_m[0]), float(sigmas_m[0])
    scale = hidden * diameters_m
    sigma = np.sqrt(np.maximum(sigmas_m**2 - scale**2, scale**2 / 100))
    low, high = float((diameters_m - 3 * sigma).min()), float((diameters_m + 3 * sigma + 3 * scale).max())
    candidates = np.linspace(max(low, 0.0), high, CANDIDATES)
    short = candidates[:, None] - diameters_m
    log_density = log_ndtr(short / sigma - sigma / scale) - short / scale + (sigma / scale) ** 2 / 2
    log_likelihood = log_density.sum(axis=1) / (1.0 + SHARED * (len(diameters_m) - 1))
    weight = np.exp(log_likelihood - log_likelihood.max())
    weight /= weight.sum()
    mean = float(weight @ candidates)
    return mean, float(np.sqrt(weight @ (candidates - mean) ** 2))


def _mahalanobis2(deviations: Array, information: Array) -> Array:
    return np.asarray(np.einsum("vi,vij,vj->v", deviations, information, deviations))
