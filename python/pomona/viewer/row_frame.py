"""The frame in which the page shows a map: x along the row, y across, z up, in metres."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.plot.projections import side_and_plan, view_from_above
from pomona.store.opening import snapshot
from pomona.store.rows import columns_of

__all__ = ["page_from_map", "vertical_of"]

Array = NDArray[np.float64]

ONE_UP = 0.9
"""Length of the mean of the cameras' own verticals from which they agree: they are within 25 degrees of each other."""


def page_from_map(positions_in_map: Array, up: Array | None) -> Array:
    """Give the rigid transform, (4, 4), that lays a map's fruits, (N, 3), along x, the lowest at z = 0.

    Without a vertical the second extent of the row stands for it, upwards where z of the map is, or against y as
    cameras have it.
    """
    if up is None:
        up = side_and_plan(positions_in_map)[0].axes[1]
        if up[1] == up[np.argmax(np.abs(up))]:
            up = -up
    along, across = view_from_above(positions_in_map, up).axes
    rotation = np.stack([along, across, up / np.linalg.norm(up)])
    turned = positions_in_map @ rotation.T
    origin = np.zeros(3)
    if len(turned):
        origin = np.array([turned[:, 0].min(), turned[:, 1].mean(), turned[:, 2].min()])
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation, -origin
    return transform


def vertical_of(path: Path) -> Array | None:
    """Tell the vertical by the cameras of a map, whose y points down; None where there are none or they differ."""
    with snapshot(path) as (connection, _):
        cells = columns_of(connection, "poses", ("qx", "qy", "qz", "qw"))
    x, y, z, w = np.array(cells, dtype=np.float64)
    if not len(x):
        return None
    down = np.stack([2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)], axis=1).mean(axis=0)
    return -down / np.linalg.norm(down) if np.linalg.norm(down) > ONE_UP else None
