"""What pictures say of points: their disparities in a stereo pair, or beside a depth picture.

Coordinates are OpenCV's here, the centre of the first pixel at 0; so are those of the core's odometry.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.odometry.picture_settings import PictureSettings

__all__ = ["DepthDisparities", "PairDisparities", "halvings", "is_flat"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]


def is_flat(picture: Picture, settings: PictureSettings) -> bool:
    """Whether a picture shows nothing."""
    _, contrast = cv2.meanStdDev(np.ascontiguousarray(picture[::4, ::4]))
    return float(contrast[0, 0]) < settings.flat_contrast


def halvings(picture: Picture, levels: int) -> tuple[Picture, ...]:
    """Give the picture and its halvings, each smoothed, finest first."""
    pictures = [picture]
    for _ in range(levels):
        pictures.append(np.asarray(cv2.pyrDown(pictures[-1]), np.uint8))
    return tuple(pictures)


@dataclass(frozen=True, eq=False)
class PairDisparities:
    """Disparities in a rectified pair that was exposed alike, both with halvings, searched for up to `farthest_px`."""

    left: tuple[Picture, ...]
    right: tuple[Picture, ...]
    farthest_px: float
    settings: PictureSettings
    looking: _core.Looking

    def __call__(self, points: Array, expected: Array) -> Array:
        """Measure disparities (N,) of points (N, 2), NaN where there is none.

        Parameters
        ----------
        expected : (N,)
            Disparities that are known roughly; NaN where the whole row is to be searched.
        """
        guess, unknown = expected.copy(), np.isnan(expected)
        guess[unknown] = self.looking.disparities(self.left, self.right, points[unknown], self.farthest_px)
        known = np.flatnonzero(np.isfinite(guess))
        there = points[known] - np.stack([guess[known], np.zeros(len(known))], axis=1)
        places, kept = self.looking.follow(self.left[:1], self.right[:1], points[known], there)
        kept &= np.abs(places[:, 1] - points[known, 1]) < self.settings.max_row_error_px
        found = points[known, 0] - places[:, 0]
        kept &= found > self.settings.min_disparity_px
        result = np.full(len(points), np.nan)
        result[known[kept]] = found[kept]
        return result


@dataclass(frozen=True, eq=False)
class DepthDisparities:
    """Disparities that a stereo camera would see, with focal length times baseline `reach_px_m`."""

    depth_m: NDArray[np.float32]
    reach_px_m: float
    settings: PictureSettings

    def __call__(self, points: Array, expected: Array) -> Array:
        """Read disparities (N,) of points (N, 2), NaN at edges and holes of the depth; nothing is searched for."""
        del expected
        x, y = np.rint(points).astype(int).T
        height, width = self.depth_m.shape
        columns = np.clip(x[:, None] + (-1, 0, 1), 0, width - 1)[:, None, :]
        rows = np.clip(y[:, None] + (-1, 0, 1), 0, height - 1)[:, :, None]
        around = self.depth_m[rows, columns].reshape(len(points), 9).astype(np.float64)
        near, far = around.min(axis=1), around.max(axis=1)
        smooth = (near > 0) & (far < (1 + self.settings.depth_edge) * near)
        return np.where(smooth, self.reach_px_m / np.where(smooth, np.median(around, axis=1), 1.0), np.nan)
