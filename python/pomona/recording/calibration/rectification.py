"""From cameras as they are to one rectified pinhole: rows of left and right agree, lines are straight."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording.calibration.pinhole import Calibration, checked_baseline_m
from pomona.recording.calibration.rig import Rig, RigCamera

__all__ = ["Optics", "rectified"]

Maps = tuple[NDArray[np.float32], NDArray[np.float32]]

SAME_PX = 1e-3
"""Cameras that agree to a thousandth of a pixel over the whole picture need no resampling."""


@dataclass(frozen=True, eq=False)
class Optics:
    """A rectified camera, and how its pictures are made of those that were recorded.

    Attributes
    ----------
    calibration : Calibration
        Of the rectified pictures.
    rectified_from_left : (3, 3) float64
        Rotation of the rectified left camera against the recorded one.
    inputs : tuple of Path
        Files it came from.
    """

    calibration: Calibration
    rectified_from_left: NDArray[np.float64]
    inputs: tuple[Path, ...]
    left_maps: Maps | None = None
    right_maps: Maps | None = None

    @classmethod
    def of(cls, calibration: Calibration, *inputs: Path) -> Optics:
        """Take pictures that are rectified already."""
        return cls(calibration, np.eye(3), inputs)

    def left(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Rectify a left picture."""
        return _resampled(picture, self.left_maps)

    def right(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Rectify a right picture."""
        return _resampled(picture, self.right_maps)

    def depth(self, depth_m: NDArray[np.float32]) -> NDArray[np.float32]:
        """Undistort a depth picture; depths are taken, not mixed, because a mean of two surfaces is none."""
        import cv2

        if self.left_maps is None:
            return depth_m
        return np.asarray(cv2.remap(depth_m, *self.left_maps, cv2.INTER_NEAREST), np.float32)


def _resampled(picture: NDArray[np.uint8], maps: Maps | None) -> NDArray[np.uint8]:
    import cv2

    return picture if maps is None else np.asarray(cv2.remap(picture, *maps, cv2.INTER_LINEAR), np.uint8)


def rectified(rig: Rig, size_px: tuple[int, int], *, stereo: bool, depth_unit_m: float = 0.001) -> Optics:
    """Rectify a rig for pictures of a size.

    Where the calibration brings its rectification along (ROS, OpenCV) it is used, so that detections and other tools
    agree; else Bouguet's (`cv2.stereoRectify`), cropped to valid pixels.

    Raises
    ------
    PomonaError
        When the size differs, a stereo recording has no baseline or one that is not in metres, or OpenCV cannot.
    """
    import cv2

    try:
        return _rectified(rig, size_px, stereo, depth_unit_m)
    except cv2.error:
        raise PomonaError(
            f"{rig.where}: found cameras that cannot be rectified, expected those of a recording"
        ) from None


def _rectified(rig: Rig, size_px: tuple[int, int], stereo: bool, depth_unit_m: float) -> Optics:
    for camera in (rig.left, rig.right if stereo else None):
        if camera is not None and camera.size_px not in (None, size_px):
            found, expected = ("{}x{}".format(*size or ()) for size in (camera.size_px, size_px))
            raise PomonaError(f"{rig.where}: found a calibration for {found}, expected {expected} as the pictures are")
    if not stereo:
        return _single(rig, size_px, depth_unit_m)
    if rig.right is None:
        raise PomonaError(f"{rig.where}: no baseline: found one camera, expected the right one and its distance too")
    left_rotation, left_projection, right_rotation, right_projection = _bouguet(rig, rig.right, size_px)
    if not (np.isfinite([left_projection, right_projection]).all() and right_projection[0, 0] > 0):
        raise PomonaError(f"{rig.where}: found cameras that cannot be rectified, expected those of a pair")
    if abs(right_projection[1, 3]) > abs(right_projection[0, 3]):
        raise PomonaError(f"{rig.where}: the cameras are one above the other, expected left and right")
    baseline_m = (left_projection[0, 3] - right_projection[0, 3]) / right_projection[0, 0]
    checked_baseline_m(rig.where, float(baseline_m))
    if abs(left_projection[0, 2] - right_projection[0, 2]) > SAME_PX:
        raise PomonaError(f"{rig.where}: cx differs between left and right, expected disparity 0 at infinity")
    return Optics(
        calibration=_calibration(left_projection, size_px, float(baseline_m), depth_unit_m),
        rectified_from_left=left_rotation,
        inputs=rig.paths,
        left_maps=_maps(rig.left, left_rotation, left_projection, size_px),
        right_maps=_maps(rig.right, right_rotation, right_projection, size_px),
    )


def _single(rig: Rig, size_px: tuple[int, int], depth_unit_m: float) -> Optics:
    projection = np.hstack([rig.left.matrix, np.zeros((3, 1))])
    return Optics(
        calibration=_calibration(projection, size_px, None, depth_unit_m),
        rectified_from_left=np.eye(3),
        inputs=rig.paths,
        left_maps=_maps(rig.left, np.eye(3), projection, size_px),
    )


def _calibration(
    projection: NDArray[np.float64], size_px: tuple[int, int], baseline_m: float | None, depth_unit_m: float
) -> Calibration:
    # + 1/2: from OpenCV's pixel centres to our corners.
    return Calibration(
        width=size_px[0],
        height=size_px[1],
        fx=float(projection[0, 0]),
        fy=float(projection[1, 1]),
        cx=float(projection[0, 2]) + 0.5,
        cy=float(projection[1, 2]) + 0.5,
        baseline_m=baseline_m,
        depth_unit_m=depth_unit_m,
    )


def _bouguet(rig: Rig, right: RigCamera, size_px: tuple[int, int]) -> tuple[NDArray[np.float64], ...]:
    """Give rotation and projection of left and right."""
    import cv2

    given = (rig.left.rotation, rig.left.projection, right.rotation, right.projection)
    if all(part is not None for part in given):
        return tuple(np.asarray(part, np.float64) for part in given)
    if rig.right_from_left is None or not np.isfinite(rig.right_from_left).all():
        raise PomonaError(f"{rig.where}: no baseline: found no place of the right camera, expected it in metres")
    rotation, translation_m = rig.right_from_left[:3, :3], rig.right_from_left[:3, 3]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-2:
        raise PomonaError(f"{rig.where}: found a place of the right camera that stretches, expected rotation and shift")
    if _aligned(rig.left, right, rotation, translation_m):
        left_projection = np.hstack([rig.left.matrix, np.zeros((3, 1))])
        shift = rig.left.matrix @ np.array([[translation_m[0]], [0.0], [0.0]])
        return np.eye(3), left_projection, np.eye(3), np.hstack([rig.left.matrix, shift])
    rotation, translation_m = np.ascontiguousarray(rotation), translation_m.reshape(3, 1).copy()
    cameras = (rig.left.matrix, _coefficients(rig.left), right.matrix, _coefficients(right))
    if rig.left.fisheye:
        # The fisheye variant takes no alpha; its balance 0 crops to valid pixels.
        found = cv2.fisheye.stereoRectify(*cameras, size_px, rotation, translation_m, cv2.CALIB_ZERO_DISPARITY)[:4]
    else:
        found = cv2.stereoRectify(
            *cameras, size_px, rotation, translation_m, flags=cv2.CALIB_ZERO_DISPARITY, alpha=0.0
        )[:4]
    left_rotation, right_rotation, left_projection, right_projection = (np.asarray(part, np.float64) for part in found)
    return left_rotation, left_projection, right_rotation, right_projection


def _aligned(
    left: RigCamera, right: RigCamera, rotation: NDArray[np.float64], translation_m: NDArray[np.float64]
) -> bool:
    """Whether the cameras are rectified as they stand."""
    straight = not left.distortion.any() and not right.distortion.any()
    turn_px = left.matrix[0, 0] * float(np.abs(rotation - np.eye(3)).max())
    skew_px = left.matrix[0, 0] * float(np.abs(translation_m[1:]).max()) / (abs(float(translation_m[0])) + 1e-12)
    unlike_px = float(np.abs(left.matrix - right.matrix).max())
    return straight and max(turn_px, skew_px, unlike_px) < SAME_PX


def _coefficients(camera: RigCamera) -> NDArray[np.float64]:
    if len(camera.distortion):
        return camera.distortion
    return np.zeros(4 if camera.fisheye else 5)


def _maps(
    camera: RigCamera, rotation: NDArray[np.float64], projection: NDArray[np.float64], size_px: tuple[int, int]
) -> Maps | None:
    import cv2

    unmoved = np.abs(rotation - np.eye(3)).max() * camera.matrix[0, 0] < SAME_PX
    if unmoved and not camera.distortion.any() and np.abs(projection[:, :3] - camera.matrix).max() < SAME_PX:
        return None
    make = cv2.fisheye.initUndistortRectifyMap if camera.fisheye else cv2.initUndistortRectifyMap
    x, y = make(camera.matrix, _coefficients(camera), rotation, projection[:, :3], size_px, cv2.CV_32FC1)
    return np.asarray(x, np.float32), np.asarray(y, np.float32)
