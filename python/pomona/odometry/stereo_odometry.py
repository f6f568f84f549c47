"""The facade: pictures in, motions out; a break is told and never bridged by a guess."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.odometry.features import disparities, is_flat
from pomona.odometry.motion import Motion
from pomona.odometry.part import Part
from pomona.odometry.reference import Measure
from pomona.odometry.trajectory import OdometryTrajectory, trajectory_of
from pomona.odometry.window import Camera
from pomona.recording import Calibration
from pomona.stereo.exposure import like

__all__ = ["StereoOdometry"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

NEAREST_M = 0.4
"""Depths from here on are searched for: nearer things fill the picture with one leaf."""

DEPTH_BASELINE_M = 0.1
"""A depth camera counts as a stereo camera this wide: 0.5 px of disparity are then 5 mm at 1 m with f = 900 px, and
grow with the square of the depth, as those of active stereo do; time-of-flight cameras are better than that."""

CENTRE_PX = 0.5
"""The centre of the first pixel, which is at 0 in OpenCV."""


class StereoOdometry:
    """Motion of a stereo or depth camera from its pictures, online.

    Corners are followed from the newest keyframe (Lucas and Kanade), a pose is taken on which they agree (three points,
    consensus, robust adjustment), and keyframes are adjusted together in a window. A frame that cannot be placed has no
    pose; when the next one cannot be placed either, a new part begins there, in a frame of reference of its own.

    Parameters
    ----------
    calibration : Calibration
        The rectified left camera, and the baseline unless only depth is given.
    """

    def __init__(self, calibration: Calibration) -> None:
        baseline_m = calibration.baseline_m or DEPTH_BASELINE_M
        centre = (calibration.cx - CENTRE_PX, calibration.cy - CENTRE_PX)
        self._calibration = calibration
        focal = (calibration.fx, calibration.fy)
        self._camera = Camera(*calibration.size_px, *focal, *centre, baseline_m)
        self._parts: list[Part] = []
        self._count = 0
        self._failed: str | None = None

    def __call__(self, left: Picture, right: Picture) -> Motion:
        """Take the next frame of a stereo camera.

        Parameters
        ----------
        left, right : (H, W) uint8
            Rectified grey pictures.

        Raises
        ------
        PomonaError
            When there is no baseline, or the pictures have another size than the calibration says.
        """
        if self._calibration.baseline_m is None:
            raise PomonaError("odometry: found no baseline in the calibration, expected one, or depth pictures")
        self._check(left, "left")
        self._check(right, "right")
        farthest_px = min(self._camera.fx * self._camera.baseline_m / NEAREST_M, self._calibration.width / 2)
        measure = partial(disparities, left, like(right, left), farthest=farthest_px)
        return self._take(left, measure, is_flat(right))

    def with_depth(self, left: Picture, depth_m: NDArray[np.float32]) -> Motion:
        """Take the next frame of a depth camera.

        Parameters
        ----------
        left : (H, W) uint8
            Grey picture.
        depth_m : (H, W) float32
            Depth along the optical axis in the same pixels, metres, 0 where nothing was measured.

        Raises
        ------
        PomonaError
            When a picture has another size than the calibration says.
        """
        self._check(left, "left")
        self._check(depth_m, "depth")
        return self._take(
            left, partial(_disparities_of_depth, depth_m, self._camera.fx * self._camera.baseline_m), False
        )

    def skip(self, reason: str) -> Motion:
        """Take a frame whose picture cannot be read."""
        self._count += 1
        return self._lose(reason)

    def trajectory(self) -> OdometryTrajectory:
        """Give the refined poses so far and the motions between them."""
        return trajectory_of(self._parts)

    def _take(self, left: Picture, measure: Measure, flat: bool) -> Motion:
        frame, self._count = self._count, self._count + 1
        if flat or is_flat(left):
            return self._lose("the picture shows nothing")
        if self._parts:
            part = self._parts[-1]
            placed = part.place(frame, left, measure)
            if not isinstance(placed, str):
                self._failed = None
                return self._motion(frame, keyframe=placed)
            if self._failed is None:
                return self._lose(placed)
            self._failed = f"{self._failed}; then {placed}"
        begun = Part.begin(self._camera, frame, left, measure)
        if isinstance(begun, str):
            return self._lose(begun)
        broken, self._failed = (self._failed if self._parts else None), None
        if self._parts:
            self._parts[-1].end()
        self._parts.append(begun)
        return self._motion(frame, keyframe=True, broken=broken)

    def _motion(self, frame: int, *, keyframe: bool, broken: str | None = None) -> Motion:
        part = self._parts[-1]
        inliers = part.frames[frame].inliers
        return Motion(part.pose(frame), len(self._parts) - 1, broken, inliers=inliers, keyframe=keyframe)

    def _lose(self, reason: str) -> Motion:
        self._failed = self._failed or reason
        return Motion(None, max(len(self._parts) - 1, 0), lost=reason)

    def _check(self, picture: NDArray[np.generic], name: str) -> None:
        width, height = self._calibration.size_px
        if picture.shape != (height, width):
            found = " x ".join(map(str, picture.shape[::-1]))
            raise PomonaError(f"odometry: {name}: found a picture of {found}, expected grey, {width} x {height}")


def _disparities_of_depth(depth_m: NDArray[np.float32], reach: float, points: Array, _expected: Array) -> Array:
    """Disparities of a stereo camera with focal length times baseline `reach`, NaN at edges and holes of the depth."""
    x, y = np.rint(points).astype(int).T
    height, width = depth_m.shape
    columns = np.clip(x[:, None] + (-1, 0, 1), 0, width - 1)[:, None, :]
    rows = np.clip(y[:, None] + (-1, 0, 1), 0, height - 1)[:, :, None]
    around = depth_m[rows, columns].reshape(len(points), 9).astype(np.float64)
    near, far = around.min(axis=1), around.max(axis=1)
    smooth = (near > 0) & (far < 1.05 * near)
    return np.where(smooth, reach / np.where(smooth, np.median(around, axis=1), 1.0), np.nan)
