"""One fruit out of many sightings: the face of the core's `lifting::fusion`, which has the equations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona import _core

__all__ = ["fuse_centres", "fuse_diameters"]

Array = NDArray[np.float64]


def fuse_centres(centres: Array, covariances: Array, rays: Array) -> tuple[Array, Array]:
    """Fuse sightings of one fruit, robustly: a wrong depth loses its weight and leaves its ray.

    Parameters
    ----------
    centres : (V, 3) float64
        In one frame of reference, metres; at least one.
    covariances : (V, 3, 3) float64
        Positive definite, square metres.
    rays : (V, 3) float64
        Direction in which each saw the fruit, of any length.

    Returns
    -------
    centre : (3,) float64
    covariance : (3, 3) float64
        Larger where most sightings disagree by more than they say.

    Raises
    ------
    ValueError
        When there is no sighting, or a covariance is not positive definite.
    """
    return _core.fuse_centres(
        np.asarray(centres, np.float64), np.asarray(covariances, np.float64), np.asarray(rays, np.float64)
    )


def fuse_diameters(diameters_m: Array, sigmas_m: Array, hidden: Array) -> tuple[float, float]:
    """Fuse diameters of one fruit: Gaussian noise, and a hidden part that only makes them smaller.

    One sighting alone stays as it is: nothing says how much of it is hidden.

    Parameters
    ----------
    diameters_m : (V,) float64
        As the sightings measured them; at least one.
    sigmas_m : (V,) float64
        Their standard deviations, what leaves hide included.
    hidden : (V,) float64
        Mean part of the diameter that leaves are expected to hide.

    Returns
    -------
    diameter_m, sigma_m : float
        Mean and standard deviation of the likelihood.
    """
    return _core.fuse_diameters(
        np.asarray(diameters_m, np.float64), np.asarray(sigmas_m, np.float64), np.asarray(hidden, np.float64)
    )
