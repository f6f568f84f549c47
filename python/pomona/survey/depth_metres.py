"""Whether pictures of depth hold metres: fruits have sizes of fruits there, and larger boxes are nearer.

A box as wide as w pixels at depth z holds a fruit of z w / f. A wrong unit makes all of them as much too large or too
small. Disparities, and other numbers that grow towards the camera, may have sizes of fruits, but boxes of one kind of
fruit are as wide as 1 / z, and there they are wider the deeper they lie.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.recording import Calibration
from pomona.survey.sampled_boxes import Pixels

__all__ = ["MEDIAN_M", "fault_of_metres"]

Array = NDArray[np.float64]

MEDIAN_M = (0.01, 0.25)
"""Of the fruits of a row; apples in a depth unit of a tenth are 6 to 9 mm, in one of five times as much 30 cm. Single
fruits may be smaller, or larger."""

INNER = 0.5
"""Part of a box, each way, in whose middle depth is looked up."""

SOME, FILLED = 20, 0.05
"""Boxes with depth in them below which nothing is said, and their share below which that is."""

STEEPEST, SURE = 0.3, 5.0
"""Slope of the logarithm of the width over that of the depth, which is -1 of depth in metres and +1 of disparities, and
standard errors that it is above zero."""


def fault_of_metres(
    depths: dict[int, NDArray[np.float32]], boxes_of: dict[int, Pixels], calibration: Calibration
) -> str | None:
    """Say why the numbers in the depth pictures of some frames are no metres, by the boxes of these frames.

    Parameters
    ----------
    depths : mapping of frame to (H, W) float32
        As read, metres, 0 where there is none.
    boxes_of : mapping of frame to (D, 4) float64
    """
    told = [_depths_and_widths(depth_m, boxes_of[frame]) for frame, depth_m in depths.items()]
    depths_m, widths_px = np.concatenate([np.zeros((2, 0)), *told], axis=1)
    n_boxes = sum(len(boxes_of[frame]) for frame in depths)
    if n_boxes >= SOME and len(depths_m) < FILLED * n_boxes:
        return f"depth is in {len(depths_m)} of {n_boxes} boxes, expected in most: check the depth pictures"
    if len(depths_m) < SOME:
        return None
    low_m, high_m = MEDIAN_M
    diameter_m = float(np.median(depths_m * widths_px)) / calibration.fx
    if not low_m <= diameter_m <= high_m:
        expected = f"expected {1000 * low_m:g} to {1000 * high_m:g} mm"
        unit = f"depth_unit_m {calibration.depth_unit_m:g}, fx {calibration.fx:g} px"
        return f"boxes are {1000 * diameter_m:.3g} mm wide at the depth in them (median), {expected}: check {unit}"
    slope, error = _slope(np.log(depths_m), np.log(widths_px))
    if slope < max(STEEPEST, SURE * error):
        return None
    return (
        "larger boxes are deeper in the depth pictures, expected nearer, as fruits of one size are: are these "
        "disparities? depth is metres along the optical axis"
    )


def _depths_and_widths(depth_m: NDArray[np.float32], boxes_px: Pixels) -> Array:
    """Give the median depth in the middle of each box that has some, and the width of the box, (2, N)."""
    middles, sides = (boxes_px[:, :2] + boxes_px[:, 2:]) / 2, boxes_px[:, 2:] - boxes_px[:, :2]
    corners = np.concatenate([np.floor(middles - INNER * sides / 2), np.ceil(middles + INNER * sides / 2)], axis=1)
    corners = np.clip(corners, 0, np.tile(depth_m.shape[::-1], 2)).astype(int)
    found = []
    for (x, y, to_x, to_y), width_px in zip(corners.tolist(), np.sqrt(sides.prod(axis=1)).tolist(), strict=True):
        inside = depth_m[y:to_y, x:to_x]
        known = inside[(inside > 0) & np.isfinite(inside)]
        if len(known) and width_px > 0:
            found.append((float(np.median(known)), width_px))
    return np.array(found, np.float64).reshape(-1, 2).T


def _slope(x: Array, y: Array) -> tuple[float, float]:
    """Give the slope of a straight line through points by least squares, and its standard error."""
    across, up = x - x.mean(), y - y.mean()
    spread = float(across @ across)
    if spread <= 0:
        return 0.0, np.inf
    slope = float(across @ up) / spread
    rest = up - slope * across
    return slope, float(np.sqrt(rest @ rest / (len(x) - 2) / spread))
