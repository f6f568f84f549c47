"""Errors of places: noise along the line of sight and across it, and the drift of the trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.seasons.season_plan import SeasonPlan

__all__ = ["drifted", "ray_covariances"]


def ray_covariances(plan: SeasonPlan, rays: NDArray[np.float64]) -> NDArray[np.float64]:
    r"""Covariances, (N, 3, 3), of places seen along unit vectors, (N, 3).

    With $k$ the ratio of along to across, $\sigma_\mathrm{across}^2 = 3 \sigma^2 / (k^2 + 2)$ keeps the mean over the
    three axes at $\sigma^2$.
    """
    across = 3.0 * plan.noise_m**2 / (plan.along_ray**2 + 2.0)
    outer = rays[:, :, None] * rays[:, None, :]
    return np.asarray(across * (np.eye(3) + (plan.along_ray**2 - 1.0) * outer))


def drifted(rng: np.random.Generator, plan: SeasonPlan, positions_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stretch a visit along the row and bulge its middle sideways and upwards, (N, 3)."""
    length = plan.design.n_trees * plan.design.training.spacing_m
    stretch = plan.drift_scale_sigma * rng.normal()
    bulge = plan.drift_bend_m * rng.normal(size=2) * [1.0, 0.5]
    along = positions_m[:, 0] / length - 0.5 + 0.5 / plan.design.n_trees
    moved = positions_m.copy()
    moved[:, 0] += stretch * along * length
    moved[:, 1:] += (1.0 - 4.0 * along[:, None] ** 2) * bulge
    return moved
