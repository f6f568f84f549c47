"""Depth of a camera of its own, seen from the left one: what RealSense and Kinect record without aligning it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.recording.calibration import Calibration
from pomona.recording.calibration.rig import RigCamera

__all__ = ["Registration", "is_aligned"]

SAME_PX, SAME_M = 0.5, 0.001
"""Cameras that agree to half a pixel, a millimetre and half a pixel's angle are one."""


def is_aligned(depth: RigCamera, left: RigCamera, left_from_depth: NDArray[np.float64] | None) -> bool:
    """Whether depth lies in the left picture as it is; without a known transform the cameras' matrices decide."""
    same_camera = depth.size_px == left.size_px and np.abs(depth.matrix - left.matrix).max() <= SAME_PX
    if left_from_depth is None:
        return bool(same_camera)
    turned_px = left.matrix[0, 0] * np.abs(left_from_depth[:3, :3] - np.eye(3)).max()
    return bool(same_camera and turned_px <= SAME_PX and np.abs(left_from_depth[:3, 3]).max() <= SAME_M)


@dataclass(frozen=True, eq=False)
class Registration:
    """Moves depth pictures into the rectified left picture.

    Attributes
    ----------
    rays : (H, W, 3) float32
        Direction (x, y, 1) of each pixel of the depth camera.
    left_from_depth : (4, 4) float64
        Of the rectified left camera.
    calibration : Calibration
        Of the rectified left camera.
    footprint_px : int
        A pixel of depth covers so many pixels of the left picture in rows and columns, without gaps.
    """

    rays: NDArray[np.float32]
    left_from_depth: NDArray[np.float64]
    calibration: Calibration
    footprint_px: int

    @classmethod
    def between(
        cls, depth: RigCamera, size_px: tuple[int, int], calibration: Calibration, left_from_depth: NDArray[np.float64]
    ) -> Registration:
        """Prepare it for a depth camera and pictures of a size."""
        import cv2

        columns, rows = np.meshgrid(np.arange(size_px[0], dtype=np.float64), np.arange(size_px[1], dtype=np.float64))
        pixels = np.stack([columns, rows], axis=-1).reshape(-1, 1, 2)
        undistort = cv2.fisheye.undistortPoints if depth.fisheye else cv2.undistortPoints
        if depth.distortion.any():
            plane = undistort(pixels, depth.matrix, depth.distortion)
        else:
            plane = (pixels - depth.matrix[:2, 2]) / np.diag(depth.matrix)[:2]
        rays = np.ones((size_px[1], size_px[0], 3), np.float32)
        rays[:, :, :2] = np.asarray(plane).reshape(size_px[1], size_px[0], 2)
        footprint_px = int(max(calibration.fx / depth.matrix[0, 0], calibration.fy / depth.matrix[1, 1])) + 1
        return cls(rays, left_from_depth, calibration, footprint_px)

    def __call__(self, depth_m: NDArray[np.float32]) -> NDArray[np.float32]:
        """Give depth in the left picture, metres; of two surfaces the nearer one, 0 where nothing was measured."""
        measured = depth_m > 0
        points = self.rays[measured] * depth_m[measured][:, None]
        points = points @ self.left_from_depth[:3, :3].T.astype(np.float32)
        points += self.left_from_depth[:3, 3].astype(np.float32)
        points = points[points[:, 2] > 0]
        # Written from far to near, so that the nearest stays.
        points = points[np.argsort(-points[:, 2], kind="stable")]
        camera = self.calibration
        shift_px = (self.footprint_px - 1) / 2
        columns = np.floor(camera.fx * points[:, 0] / points[:, 2] + camera.cx - shift_px).astype(np.int64)
        rows = np.floor(camera.fy * points[:, 1] / points[:, 2] + camera.cy - shift_px).astype(np.int64)
        steps = np.arange(self.footprint_px)
        # (points, footprint): each point's pixels together, or a far one would be written over a near one.
        columns = (columns[:, None, None] + steps[None, None, :]).repeat(self.footprint_px, axis=1)
        rows = (rows[:, None, None] + steps[None, :, None]).repeat(self.footprint_px, axis=2)
        depths = np.broadcast_to(points[:, 2, None, None], rows.shape)
        inside = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
        seen = np.zeros((camera.height, camera.width), np.float32)
        seen[rows[inside], columns[inside]] = depths[inside]
        return seen
