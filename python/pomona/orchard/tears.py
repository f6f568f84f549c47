"""Where a visit and the map are torn against each other, and which of the two it is.

One visit cannot tell: its parts lie to one another otherwise than in the map, and either may be wrong. A camera does
not lose its way twice by the same motion, so where a second visit shows the same tear it is the map that is torn.
"""

from __future__ import annotations

import sqlite3

import numpy as np
from numpy.typing import NDArray

from pomona.answer import Match
from pomona.cloud import FruitCloud
from pomona.store.cells import finite_json, similarity
from pomona.store.rows import columns_of

__all__ = ["beside_tears", "tears_of", "torn_alike"]

Array = NDArray[np.float64]

ALIKE_M = 0.1
"""Between where two visits put the fruits behind a tear: they scatter by centimetres, tears by decimetres and more."""

NEIGHBOURS = 5
"""Fruits of other parts beside one that are asked how near they are in the map, too."""


def tears_of(match: Match) -> list[Array]:
    """Return the motion in the map, (4, 4), from where each part but the first lies by the first's pose to its own."""
    first_from_map = _inverse(match.parts[0])
    return [np.asarray(part @ first_from_map) for part in match.parts[1:]]


def torn_alike(connection: sqlite3.Connection, match: Match, known: FruitCloud) -> str | None:
    """Return the first visit of the map that was mended for a tear which a match shows; None where none was."""
    if match.n_parts < 2:
        return None
    for name, configuration in zip(*columns_of(connection, "sessions", ("name", "configuration")), strict=True):
        noted = _noted(finite_json(configuration).get("mended"))
        for part, tear in enumerate(tears_of(match), start=1):
            behind = known.positions[match.pairs[match.part_of_pairs == part, 1]]
            if any(_are_alike(tear, other, behind) for one in noted for other in (one, _inverse(one))):
                return str(name)
    return None


def _noted(mended: object) -> list[Array]:
    """Return the tears that the configuration of a visit notes; what is no motion was written by others."""
    tears = mended.get("tears") if isinstance(mended, dict) else None
    motions = map(similarity, tears if isinstance(tears, list) else [])
    return [motion for motion in motions if motion is not None]


def _are_alike(tear: Array, other: Array, behind: Array) -> bool:
    """Tell whether two tears move fruits, (N, 3) in the map, from the same places."""
    here, there = (_moved(_inverse(motion), behind) for motion in (tear, other))
    return bool(np.median(np.linalg.norm(here - there, axis=1)) < ALIKE_M)


def _inverse(motion: Array) -> Array:
    return np.asarray(np.linalg.inv(motion), np.float64)


def _moved(motion: Array, places: Array) -> Array:
    return np.asarray(places @ motion[:3, :3].T + motion[:3, 3])


def beside_tears(match: Match, cloud: FruitCloud, known: FruitCloud) -> list[str]:
    """Return a fruit of the map beside each tear: of each part but the first the one next to the other parts."""
    from scipy.spatial import cKDTree

    seen, there = cloud.positions[match.pairs[:, 0]], known.positions[match.pairs[:, 1]]
    fruits = []
    for part in range(1, match.n_parts):
        own, others = (np.flatnonzero((match.part_of_pairs == part) == is_own) for is_own in (True, False))
        near_m, near = cKDTree(seen[others]).query(seen[own], k=range(1, min(NEIGHBOURS, len(others)) + 1))
        in_map_m = np.linalg.norm(there[others[near]] - there[own][:, None], axis=2)
        nearest = int(np.asarray(near_m + in_map_m).min(axis=1).argmin())
        fruits.append(known.label(int(match.pairs[own[nearest], 1])))
    return fruits
