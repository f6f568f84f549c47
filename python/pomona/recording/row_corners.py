"""Corners of the left picture that are sought near their row of the right one: to a part of a pixel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona import _core

__all__ = ["row_errors"]

TALLEST_PX = 540
"""Corners of taller pictures are sought in a halving: it shows the same, in patches that tell more apart."""

CORNERS, PATCH_PX, MIN_DISTANCE_PX = 250, 15, 8

LEAST_CORRELATION = 0.85
"""Of a patch with its like in the other picture; below, leaves are found everywhere among leaves."""

LARGEST_SHARE = 0.25
"""Of the width of the picture, as disparity."""


def row_errors(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Find corners of the left picture in the right one, (N, 4): column there, row here, rows apart, column here."""
    import cv2

    greys = [cv2.cvtColor(one, cv2.COLOR_BGR2GRAY) if one.ndim == 3 else one for one in (left, right)]
    if len(left) > TALLEST_PX:
        return 2.0 * row_errors(*(np.asarray(cv2.pyrDown(one), np.uint8) for one in greys))
    height, width = greys[0].shape
    half, reach = PATCH_PX // 2, _core.row_reach_px(width)
    corners = cv2.goodFeaturesToTrack(greys[0], CORNERS, 0.01, MIN_DISTANCE_PX)
    farthest = int(LARGEST_SHARE * width)
    found = []
    for x, y in () if corners is None else corners[:, 0].astype(int):
        low = max(x - half - farthest, 0)
        if not (half <= x < width - half and half + reach <= y < height - half - reach):
            continue
        patch = greys[0][y - half : y + half + 1, x - half : x + half + 1]
        strip = greys[1][y - half - reach : y + half + reach + 1, low : x + half + 1]
        similar = cv2.matchTemplate(strip, patch, cv2.TM_CCOEFF_NORMED)
        row, column = np.unravel_index(int(similar.argmax()), similar.shape)
        if similar[row, column] >= LEAST_CORRELATION and 0 < row < 2 * reach:
            found.append((low + half + column, y, row - reach + _vertex(similar[row - 1 : row + 2, column]), x))
    return np.array(found, np.float64).reshape(-1, 4)


def _vertex(three: NDArray[Any]) -> float:
    before, peak, after = map(float, three)
    bend = before - 2 * peak + after
    return 0.5 * (before - after) / bend if bend < 0 else 0.0
