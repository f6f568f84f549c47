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

OTHER_MODELS = {
    5: "OPENCV_FISHEYE",
    6: "FULL_OPENCV",
    7: "FOV",
    8: "SIMPLE_RADIAL_FISHEYE",
    9: "RADIAL_FISHEYE",
    10: "THIN_PRISM_FISHEYE",
    11: "RAD_TAN_THIN_PRISM_FISHEYE",
}
"""Names of those that are refused: binary files have only their numbers."""

LEAST_FOCAL_PX = 1e-6
"""Less shows all there is within one pixel, and pixels over it are more than numbers hold."""

ITERATIONS = 30
"""Of Newton's on the distortion; a phone's lens needs four, one that bends a million times as much twenty."""

NEAR_PX = 1e-6
"""A direction is one of a point that the lens shows so near to it."""


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
        found = shown(OTHER_MODELS.get(said, said) if isinstance(said, int) else said)
        raise PomonaError(
            f"{where}: found the camera model {found}, expected one of {names}: undistort the pictures first"
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
        if not (focal_px > LEAST_FOCAL_PX).all():
            expected = f"expected pixels above {LEAST_FOCAL_PX:g}"
            raise PomonaError(f"{where}: found the focal length {focal_px.min():g}, {expected}")
        distortion = np.array([value.get(name, 0.0) for name in ("k1", "k2", "p1", "p2")])
        centre_px = np.array([value["cx"], value["cy"]])
        camera = cls(require_size(where, size_px), focal_px, centre_px, distortion)
        if not np.isfinite(camera.edges()).all():
            found = f"found {' '.join(model.parameters)} of a lens whose picture folds before its edge"
            raise PomonaError(f"{where}: {found}, expected one that shows all of it: undistort the pictures first")
        return camera

    def edges(self) -> Array:
        """Give the least and greatest x and y over z beside the centre: xmin, ymin, xmax, ymax."""
        (width, height), (cx, cy) = self.size_px, self.centre_px
        looks = self.directions(np.array([[0, cy], [cx, 0], [width, cy], [cx, height]], np.float64))
        return np.array([looks[0, 0], looks[1, 1], looks[2, 0], looks[3, 1]])

    def directions(self, points_px: Array) -> Array:
        """Give x and y over z of picture points, (N, 2); NaN of points that the lens shows from nowhere.

        A model with k1 < 0 folds: its pictures end at a circle, beyond which directions come back towards the middle.
        """
        plain = (np.asarray(points_px, np.float64).reshape(-1, 2) - self.centre_px) / self.focal_px
        if not self.distortion.any():
            return plain
        with np.errstate(all="ignore"):
            found = plain
            for _ in range(ITERATIONS):
                found = found - self._step(found, self._bent(found) - plain)
            is_shown = (np.abs(self._bent(found) - plain) * self.focal_px < NEAR_PX).all(axis=1)
            return np.where((is_shown & self._is_before_fold(found))[:, None], found, np.nan)

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

    def _step(self, directions: Array, errors: Array) -> Array:
        """Give the steps of directions that explain errors of `_bent`, both (N, 2), by its derivatives."""
        x, y = directions[:, 0], directions[:, 1]
        k1, k2, p1, p2 = self.distortion
        r2 = x * x + y * y
        radial, slope = 1 + r2 * (k1 + r2 * k2), 2 * (k1 + 2 * r2 * k2)
        across = slope * x * y + 2 * (p1 * x + p2 * y)
        xx = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
        yy = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
        steps = np.array([yy * errors[:, 0] - across * errors[:, 1], xx * errors[:, 1] - across * errors[:, 0]])
        return np.asarray((steps / (xx * yy - across**2)).T)

    def _is_before_fold(self, directions: Array) -> NDArray[np.bool_]:
        """Tell where all the way from the middle d/dr of r + k1 r^3 + k2 r^5 is above 0."""
        k1, k2, *_ = self.distortion
        r2 = (directions**2).sum(axis=1)
        lowest = np.clip(-3 * k1 / (10 * k2), 0, r2) if k2 > 0 else r2
        return np.asarray(1 + lowest * (3 * k1 + 5 * k2 * lowest) > 0)
