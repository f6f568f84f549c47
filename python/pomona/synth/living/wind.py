"""Wind on the leaves of the wood: a mean that leans the branches, and gusts that sway them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Wind", "wind_forces"]

_AIR_KG_PER_M3, _DRAG = 1.2, 0.15
"""Leaves turn out of the wind: the drag of a crown is a fraction of its blades'."""

_GUST = 0.5
"""Amplitude of the gusts against the mean."""

_GUST_S = (1.2, 3.1)
"""Periods that a branch sways with, shortest and longest."""


@dataclass(frozen=True)
class Wind:
    """Wind at one moment.

    Attributes
    ----------
    speed_m_per_s
        Mean speed within the row: 1 is a breeze, 4 is strong.
    azimuth_rad
        Where it blows to, from the row's x towards its y.
    time_s
        The moment.
    """

    speed_m_per_s: float
    azimuth_rad: float = 0.0
    time_s: float = 0.0


def wind_forces(wind: Wind, axes: NDArray[np.int64], leaf_areas_m2: NDArray[np.float64]) -> NDArray[np.float64]:
    """Drag on blades, (L, 3) newtons; each axis sways in a time of its own."""
    share = (axes * 0.6180339887) % 1.0  # the golden ratio spreads neighbours
    period = _GUST_S[0] + (_GUST_S[1] - _GUST_S[0]) * share
    gust = 1.0 + _GUST * np.sin(2.0 * np.pi * (wind.time_s / period + 7.0 * share))
    pressure = 0.5 * _AIR_KG_PER_M3 * (wind.speed_m_per_s * gust) ** 2
    direction = [np.cos(wind.azimuth_rad), np.sin(wind.azimuth_rad), 0.0]
    return np.asarray((_DRAG * pressure * leaf_areas_m2)[:, None] * direction)
