"""Leaves on one day: unfolding, taken along by their wood, turning yellow and falling."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.living.axis_growth import unit
from pomona.synth.living.wood import along_axes
from pomona.synth.row_geometry import Leaves

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.living.bending import Bent
    from pomona.synth.living.foliage import Foliage
    from pomona.synth.living.wood import WoodAxes

__all__ = ["leaves_of_day", "unfolded"]

_YELLOW = np.array([0.46, 0.34, 0.035])
_TURNING_DAYS = 5.0
_UNFOLDING_DAYS = (-12.0, 38.0)
"""From bud break to the full size, against bloom."""


def unfolded(days: float) -> float:
    """How much of their full length blades have, 0 to 1, so many days after bloom."""
    begin, end = _UNFOLDING_DAYS
    return float(np.clip((days - begin) / (end - begin), 0.0, 1.0))


def leaves_of_day(foliage: Foliage, wood: WoodAxes, bent: Bent, days: float) -> Leaves:
    """Leaves that hang on a day."""
    grown = unfolded(days)
    on = np.flatnonzero((foliage.falling_days > days) & (grown > 0.0))
    axes, places, offsets = foliage.axes[on], foliage.places[on], foliage.offsets_m[on]
    turns = bent.turns(axes, places)
    tips = _turned(foliage.tips[on], turns)
    normals = _turned(foliage.normals[on], turns)
    normals = unit(normals - (normals * tips).sum(axis=1, keepdims=True) * tips)
    yellow = 1.0 / (1.0 + np.exp((foliage.turning_days[on] - days) / _TURNING_DAYS))[:, None]
    greens = foliage.greens[on]
    tones = greens.sum(axis=1, keepdims=True) / greens.sum(axis=1).mean() if len(on) else greens
    return Leaves(
        along_axes(wood.nodes_m, axes, places) + offsets + bent.shifts(axes, places, offsets),
        tips,
        normals,
        grown * foliage.lengths_m[on],
        grown * foliage.widths_m[on],
        foliage.folds_rad[on],
        foliage.bends_rad[on],
        np.clip((1.0 - yellow) * greens + yellow * tones * _YELLOW, 0.0, 1.0),
    )


def _turned(directions: NDArray[np.float64], turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn directions by small turns."""
    return unit(directions + np.cross(turns, directions))
