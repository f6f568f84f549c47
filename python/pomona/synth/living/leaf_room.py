"""Leaves lie on fruits, not in them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from pomona.synth.living.wood import along_axes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.living.foliage import Foliage
    from pomona.synth.living.wood import WoodAxes

__all__ = ["beside_fruits"]

_ALONG_BLADE = (0.1, 0.4, 0.7, 1.0)
_CLEARANCE_M = 0.003


def beside_fruits(
    foliage: Foliage, wood: WoodAxes, centres_m: NDArray[np.float64], radii_m: NDArray[np.float64]
) -> Foliage:
    """Move each blade out of the fruit that it is deepest in; centres (F, 3), radii (F,) at the harvest."""
    if len(centres_m) == 0 or len(foliage) == 0:
        return foliage
    bases = along_axes(wood.nodes_m, foliage.axes, foliage.places) + foliage.offsets_m
    fruits = cKDTree(centres_m)
    deepest = np.zeros(len(foliage))
    moves = np.zeros((len(foliage), 3))
    for share in _ALONG_BLADE:
        reach = foliage.lengths_m * share
        sunk = foliage.bends_rad * share * reach / 2.0
        points = bases + foliage.tips * reach[:, None] - foliage.normals * sunk[:, None]
        gaps, nearest = fruits.query(points)
        depth = radii_m[nearest] + _CLEARANCE_M - gaps
        deeper = depth > deepest
        away = (points - centres_m[nearest]) / np.maximum(gaps, 1e-6)[:, None]
        moves[deeper] = (away * depth[:, None])[deeper]
        deepest = np.where(deeper, depth, deepest)
    return replace(foliage, offsets_m=foliage.offsets_m + moves)
