"""Fruits on one day: those that hang, where the bent wood holds them, pushed apart; and those on the ground."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.living.contact import pushed_apart
from pomona.synth.living.fruit_lives import ALIVE, PICKED
from pomona.synth.row_geometry import FruitSolids

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pomona.synth.living.contact import WoodPoints
    from pomona.synth.living.crop import Crop

__all__ = ["fallen_fruits", "hanging_fruits"]

_LYING_DAYS = 30.0
"""Until a fruit on the ground has rotted, or the mower came."""

_ROTTEN = np.array([0.10, 0.055, 0.025])
_ROTTING_DAYS = 12.0


def hanging_fruits(
    crop: Crop, spur_tips_m: NDArray[np.float64], in_the_way: Sequence[WoodPoints], days: float, *, labelled: bool
) -> FruitSolids:
    """Fruits under the tips of the spurs, (S, 3), beside what is in the way; without labels all ids are 0."""
    # Before bloom there are none: their curves begin with nothing, not with a day.
    on = np.flatnonzero((crop.lives.states(days) == ALIVE) & (days > 0.0))
    diameters = crop.curves.diameters_m(days)[on]
    centres = pushed_apart(crop.centres_m(spur_tips_m, days)[on], diameters / 2.0, in_the_way)
    ids = on + 1 if labelled else np.zeros(len(on), np.int64)
    trees = crop.trees[on] if labelled else np.full(len(on), -1, np.int64)
    return _solids(crop, on, ids, trees, centres, -crop.hangs[on], days, days)


def fallen_fruits(crop: Crop, spur_tips_m: NDArray[np.float64], days: float) -> FruitSolids:
    """Fruits that dropped or were thinned not long ago, on the ground below, without labels."""
    age = days - crop.lives.ends_days
    on = np.flatnonzero((age >= 0.0) & (age < _LYING_DAYS) & (crop.lives.causes != PICKED))
    last = crop.lives.ends_days[on]
    # Where a fruit rolls to and how it lies follows from how it hung: nothing is drawn anew on any day.
    roll = crop.hangs[on] * [0.35, 0.35, 0.0]
    solids = _solids(crop, on, np.zeros(len(on), np.int64), np.full(len(on), -1, np.int64), roll, roll, days, last)
    centres = spur_tips_m[crop.spurs[on]] + roll
    centres[:, 2] = solids.heights_m / 2.0
    axes = np.tile([0.0, 0.0, 1.0], (len(on), 1))
    rot = np.minimum(age[on] / _ROTTING_DAYS, 1.0)[:, None] * 0.8
    return FruitSolids(
        solids.ids,
        solids.trees,
        centres,
        solids.diameters_m,
        solids.heights_m,
        axes,
        (1.0 - rot) * solids.ground_colours + rot * _ROTTEN,
        (1.0 - rot) * solids.blush_colours + rot * _ROTTEN,
        solids.blush_shares,
        solids.blush_directions,
    )


def _solids(
    crop: Crop,
    on: NDArray[np.int64],
    ids: NDArray[np.int64],
    trees: NDArray[np.int64],
    centres: NDArray[np.float64],
    axes: NDArray[np.float64],
    days: float,
    grown_until: float | NDArray[np.float64],
) -> FruitSolids:
    grounds, blushes, shares = crop.colours.on(days)
    diameters = crop.curves.chosen(on).diameters_m(grown_until)
    return FruitSolids(
        ids,
        trees,
        centres,
        diameters,
        crop.curves.height_share * diameters,
        axes,
        np.clip(grounds[on], 0.0, 1.0),
        np.clip(blushes[on], 0.0, 1.0),
        shares[on],
        crop.colours.blush_directions[on],
    )
