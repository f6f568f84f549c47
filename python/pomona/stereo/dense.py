"""Depth of the whole picture by semi-global matching (Hirschmueller 2008), as OpenCV has it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pomona.recording.calibration import Calibration
from pomona.stereo.exposure import like
from pomona.stereo.fruit_depth import FruitDepth
from pomona.stereo.pair import NEAREST_M, Picture, depth_of_disparity, focal_baseline_px_m, in_colour

__all__ = ["DenseStereo"]

WINDOW_PX = 3
"""Side of the window that is compared; the smoothness terms do the rest, and a larger one runs over edges."""

DISPARITY_SIGMA_PX = 0.9
"""Standard deviation of a fruit's disparity where its pixels vote, of those that are off by less than 2 px; on the
rendered row over a third is off by more."""

STEPS = 16
"""OpenCV gives disparities in sixteenths of a pixel."""


class DenseStereo:
    """Measures the depth of a whole picture; fruits are then found by the votes of their pixels.

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
        self._calibration = calibration
        most = min(focal_baseline_px_m(calibration) / nearest_m, calibration.width / 2)
        self._disparities = 16 * max(1, round(most / 16))

    def __call__(self, left: Picture, right: Picture, boxes_px: NDArray[np.float64]) -> FruitDepth:
        """Measure the depth of the whole picture; see `StereoDepth` for the arguments and errors."""
        left, right = in_colour(left, self._calibration), in_colour(right, self._calibration)
        greys = (cv2.cvtColor(one, cv2.COLOR_BGR2GRAY) for one in (left, like(right, left)))
        # Columns left of the picture repeat its edge, so that fruits there are matched too.
        wide = [cv2.copyMakeBorder(grey, 0, 0, self._disparities, 0, cv2.BORDER_REPLICATE) for grey in greys]
        matched = _matcher(self._disparities).compute(*wide)[:, self._disparities :]
        disparity_px = np.ascontiguousarray(matched, np.float32) / np.float32(STEPS)
        sigma_px = np.full(len(boxes_px), DISPARITY_SIGMA_PX)
        return FruitDepth(depth_of_disparity(disparity_px, self._calibration), sigma_px)


def _matcher(disparities: int) -> cv2.StereoSGBM:
    # Penalties as in the reference: a step of one disparity costs a quarter of any other.
    area = WINDOW_PX**2
    return cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=disparities,
        blockSize=WINDOW_PX,
        P1=8 * area,
        P2=32 * area,
        disp12MaxDiff=1,
        uniquenessRatio=10,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
