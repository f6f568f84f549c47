r"""One fruit out of many sightings: centre and diameter weighted by their covariances.

A sighting says two things that fail apart: a direction, from its box, and a depth, from pictures in which a leaf or
the row behind may have been matched instead. So its information J = C^-1 is split along its ray u,

    J_along = J u u^T J / (u^T J u),    J_across = J - J_along    (J_across u = 0),

and each part has its own robust loss: the centre is the minimum of sum_i rho_2(r_i^T J_across r_i) + rho_1(r_i^T
J_along r_i) with r_i = x - x_i and Cauchy's rho_n(m^2) = n log(1 + m^2 / n), n the degrees of freedom, what m^2 is on
average. A wrong depth then loses its weight and leaves its ray. Rays that cross make one good place of many poor
depths.

Leaves make an outline smaller, never larger. So a measured diameter D_i is the true one, less a hidden part with an
exponential distribution of mean h_i D_i, plus Gaussian noise, and the diameter comes from the likelihood

    L(D) = prod_i 1/(h_i D_i) exp(sigma_i^2 / (2 h_i^2 D_i^2) - (D - D_i) / (h_i D_i))
                  Phi((D - D_i) / sigma_i - sigma_i / (h_i D_i)).                                     (1)
"""

from __future__ import annotations

from dataclasses import dataclass

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


def fuse_centres(centres: Array, covariances: Array, rays: Array) -> tuple[Array, Array]:
    """Fuse sightings of one fruit.

    Parameters
    ----------
    centres : (V, 3) float64
        In one frame of reference, metres.
    covariances : (V, 3, 3) float64
        Positive definite, square metres.
    rays : (V, 3) float64
        Direction in which each saw the fruit, of any length.

    Returns
    -------
    centre : (3,) float64
    covariance : (3, 3) float64
        Larger where most sightings disagree by more than they say.
    """
    if len(centres) == 1:
        return centres[0], covariances[0]
    information = _Information.of(covariances, rays)
    # The cost has a valley for each depth that some sightings agree on: begin at each, keep the deepest.
    starts = np.concatenate([centres, np.median(centres, axis=0)[None]])
    found = np.array([_descend(start, centres, information) for start in starts])
    cost = [_cost(information.squares(centres - centre)) for centre in found]
    centre = found[int(np.argmin(cost))]
    squares = information.squares(centres - centre)
    weights = _weights(squares)
    total = information.sum(weights)
    # Half of them may be wrong, but where the median sighting is off, all say too much.
    disagreement = float(np.median(squares.sum(axis=1))) / MEDIAN_CHI2 * len(centres) / (len(centres) - 1)
    covariance = np.linalg.inv(total) * max(disagreement, 1.0) + SHARED * covariances.mean(axis=0)
    return centre, (covariance + covariance.T) / 2


MEDIAN_CHI2 = 2.366
"""Median of chi^2 with three degrees of freedom."""

DEGREES = np.array([2.0, 1.0])
"""Degrees of freedom of a sighting across its ray and along it."""


@dataclass(frozen=True, eq=False)
class _Information:
    """Inverse covariances (V, 3, 3), split in what a sighting says across its ray and along it."""

    across: Array
    along: Array

    @classmethod
    def of(cls, covariances: Array, rays: Array) -> _Information:
        whole = np.linalg.inv(covariances)
        pulled = np.einsum("vij,vj->vi", whole, rays)
        along = pulled[:, :, None] * pulled[:, None, :] / np.einsum("vi,vi->v", rays, pulled)[:, None, None]
        return cls(whole - along, along)

    def squares(self, deviations: Array) -> Array:
        """Squared Mahalanobis lengths across and along, (V, 2)."""
        parts = (self.across, self.along)
        return np.stack([np.einsum("vi,vij,vj->v", deviations, part, deviations) for part in parts], axis=1)

    def sum(self, weights: Array) -> Array:
        across = np.einsum("v,vij->ij", weights[:, 0], self.across)
        return np.asarray(across + np.einsum("v,vij->ij", weights[:, 1], self.along))

    def pull(self, weights: Array, centres: Array) -> Array:
        across = np.einsum("v,vij,vj->i", weights[:, 0], self.across, centres)
        return np.asarray(across + np.einsum("v,vij,vj->i", weights[:, 1], self.along, centres))


def _descend(centre: Array, centres: Array, information: _Information) -> Array:
    for _ in range(ITERATIONS):
        weights = _weights(information.squares(centres - centre))
        pull = information.pull(weights, centres)
        centre = np.asarray(np.linalg.solve(information.sum(weights), pull), np.float64)
    return centre


def _weights(squares: Array) -> Array:
    return np.asarray(1.0 / (1.0 + squares / DEGREES))


def _cost(squares: Array) -> float:
    return float((DEGREES * np.log1p(squares / DEGREES)).sum())


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
