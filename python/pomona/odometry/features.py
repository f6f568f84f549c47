"""Picture points: corners spread over the picture, followed from one picture to another, with their disparities.

Coordinates are OpenCV's here, the centre of the first pixel at 0; the camera that the geometry gets is shifted to it.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pomona import _core

__all__ = ["corners", "disparities", "follow", "is_flat"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]

CELLS_ACROSS = 16
"""Cells over which corners are spread, along the picture: 144 of 16 : 9. As many in a larger picture: it shows the
same scene."""

MIN_DISTANCE_PX = 4
"""Between corners: nearer ones see the same window."""

MIN_CORNER = 2e-4
"""Smallest eigenvalue of a corner's gradients, for pictures from 0 to 1: noise of one grey step stays below it."""

FLAT_CONTRAST = 3.0
"""Standard deviation in grey steps under which a picture shows nothing: black, covered or burnt out."""

WINDOW_PX = 13
"""Side of the windows that are compared: about a leaf at 1.5 m. Larger ones see two depths at once more often."""

LEVELS = 2
"""Halvings of the picture: finds what is up to about 20 px from where it is expected."""

FORTH_AND_BACK_PX = 1.0
"""A point that is followed forth and back must come home; occluded and repeated texture does not."""

MAX_ROW_ERROR_PX = 1.5
"""Rectified pictures show a point in the same row; real rectifications are off by a few tenths of a pixel."""

MIN_DISPARITY_PX = 1.0
"""Two standard deviations; what is farther has a direction and no place."""

EDGE_PX = 8
"""Windows this near to the edge of the picture are cut."""

CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 0.01)


def is_flat(picture: Picture) -> bool:
    """Whether a picture shows nothing."""
    return float(picture[::4, ::4].std()) < FLAT_CONTRAST


def corners(picture: Picture, taken: Array, per_cell: int) -> Array:
    """Find corners (N, 2), the strongest of each cell, none near those already `taken`; the latter count, too."""
    strength = cv2.cornerMinEigenVal(picture, 5)
    span = 2 * MIN_DISTANCE_PX + 1
    peak = (strength >= cv2.dilate(strength, np.ones((span, span), np.uint8))) & (strength > MIN_CORNER)
    height, width = picture.shape
    peak[:EDGE_PX] = peak[height - EDGE_PX :] = False
    peak[:, :EDGE_PX] = peak[:, width - EDGE_PX :] = False
    columns, rows = np.rint(taken).astype(int).T
    mask = np.zeros(picture.shape, np.uint8)
    mask[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)] = 1
    peak &= cv2.dilate(mask, np.ones((span, span), np.uint8)) == 0
    y, x = np.nonzero(peak)
    free = per_cell - np.bincount(_cells(columns, rows, width), minlength=_n_cells(picture))
    order = np.lexsort((-strength[y, x], _cells(x, y, width)))
    y, x = y[order], x[order]
    cells = _cells(x, y, width)
    first = np.searchsorted(cells, cells)
    chosen = np.arange(len(cells)) - first < free[cells]
    return np.stack([x[chosen], y[chosen]], axis=1).astype(np.float64)


def _cells(x: NDArray[Any], y: NDArray[Any], width: int) -> NDArray[np.int64]:
    side = _cell_px(width)
    return np.asarray(y // side * (width // side + 1) + x // side, np.int64)


def _n_cells(picture: Picture) -> int:
    height, width = picture.shape
    side = _cell_px(width)
    return int((height // side + 1) * (width // side + 1))


def _cell_px(width: int) -> int:
    return max(width // CELLS_ACROSS, 1)


def follow(
    first: Picture, second: Picture, points: Array, expected: Array, *, levels: int = LEVELS
) -> tuple[Array, Mask]:
    """Follow points (N, 2) from the first picture to the second (Lucas and Kanade, pyramids), forth and back.

    Parameters
    ----------
    expected : (N, 2)
        Where the second picture should show them.

    Returns
    -------
    places : (N, 2) float64
    kept : (N,) bool
        Whether a point came home.
    """
    if len(points) == 0:
        return np.zeros((0, 2)), np.zeros(0, bool)
    start, guess = points.astype(np.float32), expected.astype(np.float32)
    forth, found = _lucas_kanade(first, second, start, guess, levels)
    back, home = _lucas_kanade(second, first, forth, start.copy(), 0)
    kept = found & home & (np.linalg.norm(back - start, axis=1) < FORTH_AND_BACK_PX)
    return forth.astype(np.float64), kept & _inside(forth, second)


def _lucas_kanade(first: Picture, second: Picture, points: Any, guess: Any, levels: int) -> tuple[Any, Mask]:
    places, found, _ = cv2.calcOpticalFlowPyrLK(
        first,
        second,
        points,
        guess,
        winSize=(WINDOW_PX, WINDOW_PX),
        maxLevel=levels,
        criteria=CRITERIA,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return places, np.asarray(found)[:, 0] == 1


def _inside(points: NDArray[Any], picture: Picture) -> Mask:
    height, width = picture.shape
    x, y = points[:, 0], points[:, 1]
    edge = WINDOW_PX // 2
    return np.asarray((x >= edge) & (x < width - edge) & (y >= edge) & (y < height - edge), bool)


def disparities(left: Picture, right: Picture, points: Array, expected: Array, farthest: float) -> Array:
    """Measure disparities (N,), pixels, NaN where there is none.

    Parameters
    ----------
    expected : (N,)
        Disparities that are known roughly; NaN where the whole row is to be searched.
    farthest : float
        Largest disparity that is searched for.
    """
    guess = expected.copy()
    unknown = np.isnan(expected)
    guess[unknown] = _core.search_rows(left, right, np.rint(points[unknown]), int(farthest))
    known = np.flatnonzero(np.isfinite(guess))
    there = points[known] - np.stack([guess[known], np.zeros(len(known))], axis=1)
    places, kept = follow(left, right, points[known], there, levels=0)
    kept &= np.abs(places[:, 1] - points[known, 1]) < MAX_ROW_ERROR_PX
    found = points[known, 0] - places[:, 0]
    kept &= found > MIN_DISPARITY_PX
    result = np.full(len(points), np.nan)
    result[known[kept]] = found[kept]
    return result
