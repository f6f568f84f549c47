"""Which pictures may show the same fruits: near by and looking the same way, by growing steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.triangulation.posed_boxes import PosedPictures

__all__ = ["neighbours_of"]

RANKS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
"""Taken of the pictures in the order of their distance: of a video the nearest have no parallax, the farthest no fruit
in common, and nobody says which have both."""

SAME_WAY = 0.5
"""Least cosine between two optical axes: a fruit looks the same from 60 degrees aside, not from behind."""


def neighbours_of(pictures: PosedPictures, row: int) -> NDArray[np.int64]:
    """Give the rows of the pictures that one is compared with, nearest first."""
    axes = pictures.rotations[:, 2]
    distances = np.linalg.norm(pictures.centres - pictures.centres[row], axis=1)
    distances[axes @ axes[row] < SAME_WAY] = np.inf
    distances[row] = np.inf
    order = np.argsort(distances, kind="stable")
    order = order[: int(np.isfinite(distances).sum())]
    return np.array([order[rank - 1] for rank in RANKS if rank <= len(order)], np.int64)
