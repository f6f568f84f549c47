r"""Depth of the fruits out of a rectified stereo pair, measured only around the boxes.

With the focal length f in pixels and the baseline B, a point at depth Z lies d pixels farther left in the right
picture:

    Z = f B / d,        sigma_Z = Z^2 / (f B) sigma_d.                                               (1)

Semi-global matching (Hirschmueller 2008) runs in strips: rows about a group of boxes, columns from the boxes to as far
left as the nearest fruit can move. Boxes share a strip where that is less work than one strip for each.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording.calibration import Calibration

__all__ = ["FruitDepth", "StereoDepth"]

Picture = NDArray[np.uint8]
Strip = NDArray[np.int64]

NEAREST_M = 0.3
"""Nothing nearer than this is looked for: nearer fruits fill the picture."""

FARTHEST_M = 20.0
"""Nothing farther is taken: at 20 m a fruit is smaller than detectors see, and a pixel of disparity is worth metres."""

BESIDE_PX = 8
"""How far around a box depth is measured: what covers the fruit begins outside its box, and matching needs context."""

WINDOW_PX = 3
"""Side of the window that is compared; the smoothness terms do the rest, and a larger one runs over edges."""

DISPARITY_SIGMA_PX = 0.5
"""Standard deviation of a fruit's disparity: what its pixels err by together."""

STEPS = 16
"""OpenCV gives disparities in sixteenths of a pixel."""


@dataclass(frozen=True, eq=False)
class FruitDepth:
    """What a pair says of the depth at the boxes.

    Attributes
    ----------
    depth_m : (H, W) float32
        Depth along the optical axis of the left camera, 0 where nothing was measured: everywhere but around boxes.
    disparity_sigma_px : (D,) float64
        Standard deviation of the disparity of the fruit in each box, for `pomona.depth.lift`.
    """

    depth_m: NDArray[np.float32]
    disparity_sigma_px: NDArray[np.float64]


class StereoDepth:
    """Measures depth around boxes.

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
        if calibration.baseline_m is None:
            raise PomonaError("baseline_m: found none, expected the distance of the two cameras in metres")
        self.focal_baseline_px_m = calibration.fx * calibration.baseline_m
        self.least_disparity_px = self.focal_baseline_px_m / FARTHEST_M
        # As many disparities as half the picture is wide leave the other half to match in.
        most = min(self.focal_baseline_px_m / nearest_m, calibration.width / 2)
        self.disparities = 16 * max(1, round(most / 16))

    def __call__(self, left: Picture, right: Picture, boxes_px: NDArray[np.float64]) -> FruitDepth:
        """Measure depth around boxes.

        Parameters
        ----------
        left, right : (H, W, 3) or (H, W) uint8
            Rectified pictures, BGR or grey.
        boxes_px : (D, 4) float64
            xmin, ymin, xmax, ymax in the left picture; origin at the top left corner of the top left pixel.
        """
        left_grey, right_grey = _grey(left), _grey(right)
        disparity = np.zeros(left_grey.shape, np.float32)
        around = _around(boxes_px, left_grey.shape)
        strips, strip_of = _strips(around, self.disparities)
        for row, strip in enumerate(strips):
            found = self._match(left_grey, right_grey, strip)
            for box in around[strip_of == row]:
                x, y = slice(box[0], box[2]), slice(box[1], box[3])
                disparity[y, x] = found[y.start - strip[1] : y.stop - strip[1], x.start - strip[0] : x.stop - strip[0]]
        depth_m = np.divide(
            np.float32(self.focal_baseline_px_m),
            disparity,
            out=np.zeros_like(disparity),
            where=disparity > self.least_disparity_px,
        )
        return FruitDepth(depth_m, np.full(len(boxes_px), DISPARITY_SIGMA_PX))

    def _match(self, left: Picture, right: Picture, strip: Strip) -> NDArray[np.float32]:
        """Disparity in a strip, pixels, 0 where none was found; columns that the picture lacks repeat its edge."""
        xmin, ymin, xmax, ymax = strip
        reach = xmin - self.disparities
        first, missing = max(reach, 0), max(-reach, 0)
        matched = _matcher(self.disparities).compute(
            *(
                cv2.copyMakeBorder(picture[ymin:ymax, first:xmax], 0, 0, missing, 0, cv2.BORDER_REPLICATE)
                for picture in (left, right)
            )
        )
        found = matched[:, self.disparities :].astype(np.float32) / STEPS
        return np.maximum(found, 0)


def _grey(picture: Picture) -> Picture:
    return picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)


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


def _around(boxes_px: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Whole pixels (D, 4) of the boxes and `BESIDE_PX` around them, inside the picture."""
    low = np.floor(boxes_px[:, :2]).astype(np.int64) - BESIDE_PX
    high = np.ceil(boxes_px[:, 2:]).astype(np.int64) + BESIDE_PX
    size = np.array([shape[1], shape[0]])
    return np.concatenate([np.clip(low, 0, size), np.clip(high, 0, size)], axis=1)


def _strips(around: NDArray[np.int64], disparities: int) -> tuple[list[Strip], NDArray[np.int64]]:
    """Join boxes to strips as long as that saves work; the strips, and which strip each box is in."""
    strips = [box.copy() for box in around]
    strip_of = np.arange(len(around))
    while len(strips) > 1:
        all_ = np.array(strips)
        joined = np.concatenate(
            [np.minimum(all_[:, None, :2], all_[:, :2]), np.maximum(all_[:, None, 2:], all_[:, 2:])], axis=2
        )
        alone = _work(all_, disparities)
        saved = alone[:, None] + alone - _work(joined, disparities)
        np.fill_diagonal(saved, -1)
        one, other = sorted(np.unravel_index(int(saved.argmax()), saved.shape))
        if saved[one, other] < 0:
            break
        strips[one] = joined[one, other]
        del strips[other]
        strip_of[strip_of == other] = one
        strip_of[strip_of > other] -= 1
    return strips, strip_of


def _work(strips: NDArray[np.int64], disparities: int) -> NDArray[np.int64]:
    """Pixels that are matched in a strip."""
    width, height = strips[..., 2] - strips[..., 0], strips[..., 3] - strips[..., 1]
    return np.asarray((width + disparities) * height)
