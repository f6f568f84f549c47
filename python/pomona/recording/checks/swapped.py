"""Whether left and right are what they are called, are two, and lie beside each other: a few frames tell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording.checks.readable import is_blank
from pomona.recording.evenly import evenly
from pomona.recording.frame import Recording
from pomona.recording.pictures import UnreadablePictureError

__all__ = ["check_sides", "disparities_px"]

LOOKED_AT = 5
"""Frames, evenly over the recording, of which the first ones that show enough decide."""

ENOUGH = 40
"""Corners that must be found in both pictures before they say anything."""

SWAPPED_SHARE = 0.8
"""Of corners that are not at infinity. Chance goes both ways: 32 of 40 by chance happens once in 10,000 recordings."""

ON_END_TIMES = 4
"""As many corners above each other as beside each other, where pictures are turned: of a frame of a drawn row 41 to 105
and up to 2; in five good recordings up to 9 and 30 to 204."""

CORNERS, PATCH_PX = 300, 15

LEAST_CORRELATION = 0.85
"""Of a patch with its like in the other picture; below, leaves are found everywhere among leaves."""

NEAREST_PX = 1.0
"""Least disparity that has a sign."""

LARGEST_SHARE = 0.25
"""Of the width of the picture, as disparity."""

SAME_SHARE, SAME_PX = 0.2, 8
"""Mean difference of the two pictures, of that of one from itself moved by so many pixels: rows before two cameras make
1.1 to 1.3, however much they show, and compression of one .17 at JPEG's quality of 50."""


def check_sides(recording: Recording) -> None:
    """Refuse a recording whose left pictures are from the right camera, or are its right pictures too.

    In a rectified pair everything lies farther left in the right picture: disparities are positive. Recordings without
    right pictures, and frames that cannot be read or show nothing, say nothing.

    Raises
    ------
    PomonaError
        One line that says to swap them, to turn them back, or that both are the same.
    """
    found, on_end, same = np.zeros(0), np.zeros(0), []
    looked_at = {recording.numbers[row] for row in evenly(len(recording), LOOKED_AT)}
    for frame in recording.frames(looked_at):
        if frame.read_left is None or frame.read_right is None:
            return
        try:
            left, right = frame.read_left(), frame.read_right()
        except UnreadablePictureError:
            continue
        if not is_blank(left):
            same.append(_is_same(left, right))
        found = np.concatenate([found, disparities_px(left, right)])
        if len(found) >= ENOUGH:
            break
        turned = [np.ascontiguousarray(np.rot90(picture)) for picture in (left, right)]
        on_end = np.concatenate([on_end, disparities_px(*turned)])
    if same and all(same):
        seen = f"the same picture in {len(same)} of {len(same)} frames that were compared"
        raise PomonaError(f"{recording.path}: left and right: found {seen}, expected those of two cameras")
    if len(on_end) >= max(ENOUGH, ON_END_TIMES * len(found)):
        seen = f"{len(on_end)} corners above or below each other in both, {len(found)} beside each other"
        turned_by = "left and right are turned by a quarter"
        raise PomonaError(f"{recording.path}: {turned_by}: found {seen}, expected pictures as they were taken")
    negative = int((found < 0).sum())
    if len(found) >= ENOUGH and negative >= SWAPPED_SHARE * len(found):
        seen = f"{negative} of {len(found)} corners farther right in the right picture than in the left one"
        raise PomonaError(
            f"{recording.path}: left and right are swapped, or not of one time: found {seen}, expected farther left"
        )


def _is_same(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> bool:
    if left.shape != right.shape or left.shape[1] <= SAME_PX:
        return False
    grey = left.astype(np.float32)
    moved = np.abs(grey[:, SAME_PX:] - grey[:, :-SAME_PX]).mean()
    return float(np.abs(grey - right).mean()) < SAME_SHARE * float(moved)


def disparities_px(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Find the corners of the left picture in the same rows of the right one, to the left and to the right alike.

    Parameters
    ----------
    left, right : (H, W, 3) uint8
        A rectified pair, BGR, at most a pixel off in rows.

    Returns
    -------
    (N,) float64
        Disparities of the corners that were found and are not about at infinity.
    """
    import cv2

    half = PATCH_PX // 2
    left, right = (np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8) for picture in (left, right))
    height, width = left.shape
    reach = int(LARGEST_SHARE * width)
    inner = left[half + 1 : height - half - 1, half : width - half]
    corners = cv2.goodFeaturesToTrack(inner, CORNERS, 0.01, PATCH_PX) if inner.size else None
    if corners is None:
        return np.zeros(0)
    found = []
    for x, y in (corners.reshape(-1, 2) + np.array([half, half + 1])).astype(int).tolist():
        start, end = max(half, x - reach), min(width - half - 1, x + reach)
        patch = left[y - half : y + half + 1, x - half : x + half + 1]
        strip = right[y - half - 1 : y + half + 2, start - half : end + half + 1]
        _, correlation, _, place = cv2.minMaxLoc(cv2.matchTemplate(strip, patch, cv2.TM_CCOEFF_NORMED))
        if correlation >= LEAST_CORRELATION:
            found.append(float(x - start - place[0]))
    return np.array([disparity for disparity in found if abs(disparity) >= NEAREST_PX])
