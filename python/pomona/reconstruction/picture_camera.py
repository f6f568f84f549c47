"""The camera of a picture: what its parameters mean, and from pixels to directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import MOST_NUMBER, shown
from pomona.recording.picture_size import require_size

__all__ = ["CAMERA_MODELS", "CameraModel", "PictureCamera", "camera_model"]

Array = NDArray[np.float64]


class CameraModel(NamedTuple):
    """A camera model: its number in binary files, its name in text, and its parameters in the files' order."""

    number: int
    name: str
    parameters: tuple[str, ...]


CAMERA_MODELS = (
    CameraModel(0, "SIMPLE_PINHOLE", ("f", "cx", "cy")),
    CameraModel(1, "PINHOLE", ("fx", "fy", "cx", "cy")),
    CameraModel(2, "SIMPLE_RADIAL", ("f", "cx", "cy", "k1")),
    CameraModel(3, "RADIAL", ("f", "cx", "cy", "k1", "k2")),
    CameraModel(4, "OPENCV", ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")),
)
"""Those with at most two radial and two tangential terms, which are OpenCV's."""

ITERATIONS = 50
"""Of the inversion of the distortion; a phone's needs five, a wide lens twenty."""


def camera_model(where: str, said: str | int) -> CameraModel:
    """Give a camera model by its name or number.

    Raises
    ------
    PomonaError
        One line that begins with `where`: it is none of `CAMERA_MODELS`.
    """
    known = next((model for model in CAMERA_MODELS if said in (model.number, model.name)), None)
    if known is None:
        names = ", ".join(model.name for model in CAMERA_MODELS)
        raise PomonaError(
            f"{where}: found the camera model {shown(said)}, expected one of {names}: undistort the pictures first"
        )
    return known


@dataclass(frozen=True, eq=False)
class PictureCamera:
    """Intrinsics of one camera.

    Picture coordinates begin at the top left corner of the top left pixel, in COLMAP as here.

    Attributes
    ----------
    size_px : (width, height)
    focal_px, centre_px : (2,) float64
        fx, fy and cx, cy.
    distortion : (4,) float64
        k1, k2, p1, p2.
    """

    size_px: tuple[int, int]
    focal_px: Array
    centre_px: Array
    distortion: Array

    @classmethod
    def of(cls, where: str, model: CameraModel, size_px: tuple[int, int], numbers: tuple[float, ...]) -> PictureCamera:
        """Take the parameters of a model.

        Raises
        ------
        PomonaError
            One line that begins with `where`: a size or a number is none of a camera's.
        """
        if not all(abs(number) <= MOST_NUMBER for number in numbers):  # nor is what is NaN
            raise PomonaError(f"{where}: found NaN or infinity, expected {' '.join(model.parameters)}")
        value = dict(zip(model.parameters, numbers, strict=True))
        focal_px = np.array([value.get("fx", value.get("f", 0.0)), value.get("fy", value.get("f", 0.0))])
        if not (focal_px > 0).all():
            raise PomonaError(f"{where}: found the focal length {focal_px.min():g}, expected pixels above 0")
        distortion = np.array([value.get(name, 0.0) for name in ("k1", "k2", "p1", "p2")])
        centre_px = np.array([value["cx"], value["cy"]])
        return cls(require_size(where, size_px), focal_px, centre_px, distortion)

    def directions(self, points_px: Array) -> Array:
        """Give x and y over z of picture points, (N, 2)."""
        plain = (np.asarray(points_px, np.float64).reshape(-1, 2) - self.centre_px) / self.focal_px
        found = plain
        for _ in range(ITERATIONS if self.distortion.any() else 0):
            found = found + plain - self._bent(found)
        return found

    def project(self, directions: Array) -> Array:
        """Give the picture points of x and y over z, (N, 2)."""
        return np.asarray(self._bent(directions) * self.focal_px + self.centre_px)

    def _bent(self, directions: Array) -> Array:
        """Give where the lens shows directions, x and y over z of a pinhole (Brown and Conrady)."""
        x, y = directions[:, 0], directions[:, 1]
        k1, k2, p1, p2 = self.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * k2)
        bent_x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        bent_y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return np.stack([bent_x, bent_y], axis=1)
