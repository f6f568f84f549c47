"""Cameras as a calibration tool writes them, before rectification."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError

__all__ = ["Rig", "RigCamera", "camera_matrix"]


def camera_matrix(fx: float, fy: float, cx: float, cy: float) -> NDArray[np.float64]:
    """Give the 3x3 matrix of a pinhole."""
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class RigCamera:
    """One camera. Picture coordinates are those of OpenCV here: (0, 0) is the **centre** of the top left pixel.

    Attributes
    ----------
    matrix : (3, 3) float64
        Pinhole, pixels.
    distortion : (n,) float64
        OpenCV's coefficients: k1 k2 p1 p2 [k3 [k4 k5 k6]], or k1 k2 k3 k4 of a fisheye; empty for none.
    fisheye : bool
        Whether the distortion is the equidistant one.
    size_px : (width, height) or None
        None where the file does not say it.
    rotation, projection : (3, 3) and (3, 4) float64, or None
        Rectification that the file brings along: rectified_from_camera and K [I | t].
    """

    matrix: NDArray[np.float64]
    distortion: NDArray[np.float64]
    fisheye: bool = False
    size_px: tuple[int, int] | None = None
    rotation: NDArray[np.float64] | None = None
    projection: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False)
class Rig:
    """The left camera, and where the right one is.

    Attributes
    ----------
    paths : tuple of Path
        Files it came from.
    right_from_left : (4, 4) float64 or None
        None where there is no right camera, or where its projection says it.
    """

    paths: tuple[Path, ...]
    left: RigCamera
    right: RigCamera | None = None
    right_from_left: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        for camera in (self.left, self.right):
            arrays = (camera.matrix, camera.distortion) if camera is not None else ()
            if not all(np.isfinite(array).all() for array in arrays):
                raise PomonaError(f"{self.where}: found NaN or infinity in a camera, expected finite numbers")
            if camera is not None and min(camera.matrix[0, 0], camera.matrix[1, 1]) <= 0:
                raise PomonaError(f"{self.where}: found a focal length of {camera.matrix[0, 0]:g}, expected pixels")

    @property
    def where(self) -> str:
        """The files, for messages."""
        return ", ".join(str(path) for path in self.paths)
