"""What every kind of stereo asks of a pair."""

from __future__ import annotations

from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording.calibration import Calibration
from pomona.stereo.fruit_depth import FruitDepth

__all__ = ["NEAREST_M", "Picture", "Stereo", "depth_of_disparity", "focal_baseline_px_m", "in_colour"]

Picture = NDArray[np.uint8]

NEAREST_M = 0.3
"""Nothing nearer is looked for: nearer things fill the picture with one leaf or fruit."""

FARTHEST_M = 20.0
"""Nothing farther is taken: at 20 m a fruit is smaller than detectors see, and a pixel of disparity is worth metres."""


class Stereo(Protocol):
    """Gives the depth of a rectified pair, at least around boxes."""

    def __call__(self, left: Picture, right: Picture, boxes_px: NDArray[np.float64]) -> FruitDepth:
        """Measure depth."""


def focal_baseline_px_m(calibration: Calibration) -> float:
    """Focal length times baseline: the disparity at one metre.

    Raises
    ------
    PomonaError
        Without a baseline.
    """
    if calibration.baseline_m is None:
        raise PomonaError("baseline_m: found none, expected the distance of the two cameras in metres")
    return calibration.fx * calibration.baseline_m


def in_colour(picture: Picture, calibration: Calibration) -> Picture:
    """Give (H, W, 3) of a colour or grey picture.

    Raises
    ------
    PomonaError
        When it has another size than the calibration.
    """
    height, width = picture.shape[:2]
    if (width, height) != calibration.size_px:
        raise PomonaError(
            f"picture: found {width} x {height} pixels, expected {calibration.width} x {calibration.height}"
        )
    colour = picture if picture.ndim == 3 else cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    return np.ascontiguousarray(colour, np.uint8)


def depth_of_disparity(disparity_px: NDArray[np.float32], calibration: Calibration) -> NDArray[np.float32]:
    """Give Z = f B / d, 0 where there is no disparity or the place is too far."""
    scale = focal_baseline_px_m(calibration)
    seen = disparity_px > scale / FARTHEST_M
    return np.divide(np.float32(scale), disparity_px, out=np.zeros_like(disparity_px), where=seen)
