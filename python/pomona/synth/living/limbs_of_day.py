"""Wood on one day as rods: trunks, branches, spurs, and the stalks that hold the fruits."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.row_geometry import FruitSolids, Limbs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pomona.synth.living.bending import Bent
    from pomona.synth.living.spurs import Spurs
    from pomona.synth.living.wood import WoodAxes

__all__ = ["all_limbs", "spur_limbs", "stalk_limbs", "wood_limbs"]

_BARK, _YEARLING, _SPUR = np.array([0.105, 0.082, 0.064]), np.array([0.105, 0.062, 0.038]), (0.085, 0.065, 0.045)
_STALK = (0.12, 0.13, 0.04)
_THICK_M = 0.008
_SPUR_RADII_M, _STALK_RADIUS_M = (0.0032, 0.0026), 0.0013
_INTO_FRUIT = 0.36
"""The stalk ends in the fruit's hollow, this share of its height above the middle."""


def wood_limbs(wood: WoodAxes, bent: Bent, *, every: int = 1) -> Limbs:
    """Pieces from each `every`-th node to the next; thin wood has the colour of a shoot."""
    nodes, radii = bent.nodes_m[:, ::every], wood.radii_m[:, ::every]
    thickness = np.minimum((radii[:, 1:] + radii[:, :-1]).reshape(-1, 1) / 2.0 / _THICK_M, 1.0)
    # Neighbouring trees differ a little in their bark.
    tone = 1.0 + 0.12 * np.sin(2.4 * np.repeat(wood.trees, radii.shape[1] - 1))[:, None]
    return Limbs(
        nodes[:, :-1].reshape(-1, 3),
        nodes[:, 1:].reshape(-1, 3),
        radii[:, :-1].ravel(),
        radii[:, 1:].ravel(),
        tone * (thickness * _BARK + (1.0 - thickness) * _YEARLING),
    )


def spur_limbs(spurs: Spurs, bent: Bent, tips_m: NDArray[np.float64]) -> Limbs:
    """One rod a spur, to its tip, (S, 3)."""
    return _rods(spurs.roots(bent.nodes_m), tips_m, _SPUR_RADII_M, _SPUR)


def stalk_limbs(from_m: NDArray[np.float64], fruits: FruitSolids) -> Limbs:
    """One rod a fruit, from (F, 3) into its hollow."""
    hollows = fruits.centres_m + fruits.axes * (_INTO_FRUIT * fruits.heights_m)[:, None]
    return _rods(from_m, hollows, (_STALK_RADIUS_M, _STALK_RADIUS_M), _STALK)


def _rods(
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    radii_m: tuple[float, float],
    colour: tuple[float, float, float],
) -> Limbs:
    n = len(starts)
    return Limbs(starts, ends, np.full(n, radii_m[0]), np.full(n, radii_m[1]), np.tile(colour, (n, 1)))


def all_limbs(parts: Sequence[Limbs]) -> Limbs:
    """Put rods together."""
    return Limbs(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Limbs)))
