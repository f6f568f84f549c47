"""The facade: pictures in, motions out; the core decides (`crates/pomona/src/odometry`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.core_settings import core_settings
from pomona.errors import PomonaError
from pomona.odometry.disparity import DepthDisparities, PairDisparities, halvings, is_flat
from pomona.odometry.eyes import Eyes, Measure, View
from pomona.odometry.motion import Motion
from pomona.odometry.picture_settings import PictureSettings
from pomona.odometry.way import OdometryTrajectory
from pomona.recording import Calibration
from pomona.stereo.exposure import like

__all__ = ["StereoOdometry"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

NOTHING = "the picture shows nothing"


class StereoOdometry:
    """Motion of a stereo or depth camera from its pictures, online.

    Corners are followed from the newest keyframe (Lucas and Kanade), a pose is taken on which they agree (three points,
    consensus, robust adjustment), and keyframes are adjusted together in a window. A frame that cannot be placed has no
    pose; when the next one cannot be placed either, a new part begins there, in a frame of reference of its own.

    Parameters
    ----------
    calibration : Calibration
        The rectified left camera, and the baseline unless only depth is given.
    config : mapping, optional
        Values of the core's tables that differ from `pomona.default_config()`; the odometry's is `odometry`.

    Raises
    ------
    PomonaError
        When the configuration names a setting that does not exist, or a value is outside its range.
    """

    def __init__(self, calibration: Calibration, config: Mapping[str, Any] | None = None) -> None:
        self._calibration = calibration
        settings = core_settings(config)
        try:
            self._core = _core.Odometry(calibration, config=settings)
            self._looking = _core.Looking(settings)
        except ValueError as error:
            raise PomonaError(f"odometry: {error}") from None
        self._settings = PictureSettings.of(self._looking.settings)
        self._newest: View | None = None

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
        if is_flat(right, self._settings):
            return self.skip(NOTHING)
        _, farthest_px = self._core.disparities_px
        lefts, rights = (halvings(one, self._settings.levels) for one in (left, like(right, left)))
        return self._take(lefts, PairDisparities(lefts, rights, farthest_px, self._settings, self._looking))

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
        reach_px_m, _ = self._core.disparities_px
        lefts = halvings(left, self._settings.levels)
        return self._take(lefts, DepthDisparities(depth_m, reach_px_m, self._settings))

    def skip(self, reason: str) -> Motion:
        """Take a frame whose picture cannot be used."""
        return Motion(*self._core.skip(reason))

    def trajectory(self) -> OdometryTrajectory:
        """Give the refined poses so far and the motions between them."""
        return OdometryTrajectory(*self._core.trajectory())

    def _take(self, lefts: tuple[Picture, ...], measure: Measure) -> Motion:
        if is_flat(lefts[0], self._settings):
            return self.skip(NOTHING)
        view = View(lefts, measure)
        motion = Motion(*self._core.take(Eyes(view, self._newest, self._settings, self._looking)))
        if motion.keyframe:
            self._newest = view
        return motion

    def _check(self, picture: NDArray[np.generic], name: str) -> None:
        width, height = self._calibration.size_px
        if picture.shape != (height, width):
            found = " x ".join(map(str, picture.shape[::-1]))
            raise PomonaError(f"odometry: {name}: found a picture of {found}, expected grey, {width} x {height}")
