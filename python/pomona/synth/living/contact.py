"""What touches: fruits push one another aside, and the wood, posts and wires push them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from pomona.synth.living.wood import NODES, along_axes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pomona.synth.row_geometry import Limbs

__all__ = ["WoodPoints", "pushed_apart", "rods_as_points"]

_SPACING_M = 0.02
"""Between points of wood: a fruit between two of them is hardly nearer to the axis than it seems."""

_NEAREST = 6
"""Points that may be in a fruit at once."""

_PUSHES, _LEAST_DEPTH_M = 60, 1e-5


class WoodPoints:
    """Wood as balls along its axes; nodes (A, NODES, 3), radii (A, NODES), metres."""

    def __init__(self, nodes_m: NDArray[np.float64], radii_m: NDArray[np.float64]) -> None:
        lengths = np.linalg.norm(np.diff(nodes_m, axis=1), axis=2).sum(axis=1)
        count = np.ceil(lengths / _SPACING_M).astype(np.int64) + 1
        axes = np.repeat(np.arange(len(nodes_m)), count)
        places = (np.arange(len(axes)) - np.repeat(np.cumsum(count) - count, count)) / np.repeat(count - 1, count)
        self.points_m = along_axes(nodes_m, axes, places)
        self.radii_m = along_axes(radii_m, axes, places)
        self._tree = cKDTree(self.points_m)

    def depths_m(self, centres_m: NDArray[np.float64], radii_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """How deep the nearest points are in balls, (N, some), negative for outside."""
        gaps, which = self._near(centres_m)
        return np.asarray(radii_m[:, None] + self.radii_m[which] - gaps)

    def ways_out_m(self, centres_m: NDArray[np.float64], radii_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """How balls have to move to be clear of the point that is deepest in each, (N, 3)."""
        gaps, which = self._near(centres_m)
        depths = radii_m[:, None] + self.radii_m[which] - gaps
        deepest = depths.argmax(axis=1)
        rows = np.arange(len(centres_m))
        away = (centres_m - self.points_m[which[rows, deepest]]) / np.maximum(gaps[rows, deepest], 1e-9)[:, None]
        return np.asarray(away * np.maximum(depths[rows, deepest], 0.0)[:, None])

    def _near(self, centres_m: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        gaps, which = self._tree.query(centres_m, k=_NEAREST)
        return np.asarray(gaps), np.asarray(which)


def rods_as_points(rods: Limbs) -> list[WoodPoints]:
    """Take straight rods, such as posts and wires, each thickness apart: points of wires would crowd out others."""
    share = np.linspace(0.0, 1.0, NODES)[:, None]
    points = []
    for radius in np.unique(rods.start_radii_m):
        alike = rods.start_radii_m == radius
        nodes = (1.0 - share) * rods.starts_m[alike, None] + share * rods.ends_m[alike, None]
        points.append(WoodPoints(nodes, np.full(nodes.shape[:2], radius)))
    return points


def pushed_apart(
    centres_m: NDArray[np.float64], radii_m: NDArray[np.float64], in_the_way: Sequence[WoodPoints]
) -> NDArray[np.float64]:
    """Push fruits, (N, 3), out of what is in the way, and out of one another, half each, over and over.

    Branches that sink by different lengths bring them together.
    """
    centres = centres_m.copy()
    for _ in range(_PUSHES):
        if len(centres) == 0:
            return centres
        steps = _furthest([each.ways_out_m(centres, radii_m) for each in in_the_way])
        pairs = cKDTree(centres).query_pairs(2.0 * float(radii_m.max()), output_type="ndarray")
        pairs = pairs[np.lexsort(pairs.T)]
        between = centres[pairs[:, 1]] - centres[pairs[:, 0]]
        gaps = np.linalg.norm(between, axis=1)
        depths = np.maximum(radii_m[pairs].sum(axis=1) - gaps, 0.0)
        halves = between * (depths / np.maximum(gaps, 1e-9) / 2.0)[:, None]
        np.add.at(steps, pairs[:, 1], halves)
        np.add.at(steps, pairs[:, 0], -halves)
        if np.abs(steps).max() < _LEAST_DEPTH_M:
            return centres
        centres += steps
    return centres


def _furthest(ways_m: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Of the ways out of several things take the longest, for each fruit."""
    furthest = ways_m[0]
    for way in ways_m[1:]:
        longer = np.linalg.norm(way, axis=1) > np.linalg.norm(furthest, axis=1)
        furthest = np.where(longer[:, None], way, furthest)
    return furthest
