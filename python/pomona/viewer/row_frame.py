"""The frame in which the page shows a map: x along the row, y across, z up, in metres."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.orchard.earth_layers import stored_anchor
from pomona.plot.projections import side_and_plan, view_from_above
from pomona.store.opening import snapshot
from pomona.store.rows import columns_of

__all__ = ["Vertical", "guessed_vertical", "known_vertical", "page_from_map"]

Array = NDArray[np.float64]

ONE_UP = 0.9
"""Length of the mean of the cameras' own verticals from which they agree: they are within 25 degrees of each other."""


@dataclass(frozen=True, eq=False)
class Vertical:
    """Which way is up in a map.

    Attributes
    ----------
    up : (3,) float64
        In the map's frame, of length 1.
    is_guess : bool
        Whether nothing but the shape of the rows tells it.
    """

    up: Array
    is_guess: bool

    @classmethod
    def of(cls, path: Path, fruits: FruitCloud, up: Array | None = None) -> Vertical:
        """Take what is given, else what the map knows, else what its fruits look like."""
        known = known_vertical(path) if up is None else up
        chosen = guessed_vertical(fruits) if known is None else known
        return cls(np.asarray(chosen / np.linalg.norm(chosen)), known is None)


def page_from_map(positions_in_map: Array, up: Array) -> Array:
    """Give the rigid transform, (4, 4), that lays a map's fruits, (N, 3), along x, the lowest at z = 0."""
    along, across = view_from_above(positions_in_map, up).axes
    rotation = np.stack([along, across, up])
    turned = positions_in_map @ rotation.T
    origin = np.zeros(3)
    if len(turned):
        origin = np.array([turned[:, 0].min(), turned[:, 1].mean(), turned[:, 2].min()])
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation, -origin
    return transform


def guessed_vertical(fruits: FruitCloud) -> Array:
    """Take the second extent of the rows for the vertical: they are longer than high, and higher than deep.

    Fruits do not tell up from down: it is upwards where z of the map is, or against y as cameras have it.
    """
    positions = fruits.positions.copy()
    rows = np.array(fruits.extras.get("row", ("",) * len(fruits)))
    for row in set(rows.tolist()):
        positions[rows == row] -= positions[rows == row].mean(axis=0)
    up = side_and_plan(positions)[0].axes[1]
    return np.asarray(-up if up[1] == up[np.argmax(np.abs(up))] else up)


def known_vertical(path: Path) -> Array | None:
    """Tell the vertical of a map or session by its place on Earth, else by its cameras; None where nobody knows it."""
    with snapshot(path) as (connection, _):
        anchor = stored_anchor(connection)
    up = np.zeros(3) if anchor is None else anchor.enu_from_map[2, :3]
    return np.asarray(up) if up.any() else _vertical_of_cameras(path)


def _vertical_of_cameras(path: Path) -> Array | None:
    """Tell the vertical by cameras, whose y points down; None where there are none or they differ."""
    with snapshot(path) as (connection, _):
        cells = columns_of(connection, "poses", ("qx", "qy", "qz", "qw"))
    x, y, z, w = np.array(cells, dtype=np.float64)
    if not len(x):
        return None
    down = np.stack([2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)], axis=1).mean(axis=0)
    return -down / np.linalg.norm(down) if np.linalg.norm(down) > ONE_UP else None
