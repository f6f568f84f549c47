"""Depth of the fruits, measured only around their boxes: the face of the core's `stereo`.

Each fruit is matched as one disc, whose outline leaves only its disparity open. Equations, assumptions and figures:
docs/depth.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.recording.calibration import Calibration
from pomona.stereo.exposure import like
from pomona.stereo.fruit_depth import FruitDepth
from pomona.stereo.pair import NEAREST_M, Picture, focal_baseline_px_m, in_colour

__all__ = ["StereoDepth"]


class StereoDepth:
    """Measures depth at boxes.

    Parameters
    ----------
    calibration : Calibration
        The rectified left camera, with a baseline.
    nearest_m : float
        Nothing nearer is looked for.

    Raises
    ------
    PomonaError
        Without a baseline.
    """

    def __init__(self, calibration: Calibration, *, nearest_m: float = NEAREST_M) -> None:
        self._calibration, self._nearest_m = calibration, nearest_m
        focal_baseline_px_m(calibration)

    def __call__(self, left: Picture, right: Picture, boxes_px: NDArray[np.float64]) -> FruitDepth:
        """Measure depth at boxes.

        Parameters
        ----------
        left, right : (H, W, 3) or (H, W) uint8
            Rectified pictures, BGR or grey, of the calibration's size.
        boxes_px : (D, 4) float64
            xmin, ymin, xmax, ymax in the left picture; origin at the top left corner of the top left pixel.

        Raises
        ------
        PomonaError
            When a picture has another size.
        """
        left, right = in_colour(left, self._calibration), in_colour(right, self._calibration)
        depth_m, numbers = _core.read_pair(
            left,
            like(right, left),
            np.asarray(boxes_px, np.float64).reshape(-1, 4),
            self._calibration,
            nearest_m=self._nearest_m,
        )
        disparity_px, disparity_sigma_px, support = np.ascontiguousarray(numbers.T)
        return FruitDepth(depth_m, disparity_sigma_px, disparity_px, support)
