"""Boxes in posed pictures as directions: what association and triangulation compute with.

A round fruit of radius r touches the four planes through the camera and the edges of its box, so that the middle
between two planes goes through its centre, and r = sin(half the angle between them) times the distance in the plane
across: exact for whole fruits, also at the edge of a wide picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.reconstruction.picture_camera import PictureCamera

__all__ = ["PosedBoxes", "PosedPictures"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

EDGE_SIGMA_PX = 0.7
"""Of the middle of a box whose edges are whole pixels, or a detector's."""

SIZE_SIGMA = 0.05
"""Of the middle, in parts of the box: detectors see large fruits no better than small ones."""

LACK_SIGMA = 0.35
"""Of the middle, in parts of what a box lacks to a square: what hides a fruit hides one side of it."""


@dataclass(frozen=True, eq=False)
class PosedPictures:
    """Where pictures were taken.

    Attributes
    ----------
    rotations : (P, 3, 3) float64
        Take directions of the model into the camera.
    centres : (P, 3) float64
        Of the cameras, in the model.
    corners : (P, 4) float64
        Least and greatest x and y over z that each picture shows, of a bent one at least: xmin, ymin, xmax, ymax.
    """

    rotations: Array
    centres: Array
    corners: Array

    @classmethod
    def of(cls, camera_from_model: Array, cameras: Sequence[PictureCamera]) -> PosedPictures:
        """Take poses (P, 4, 4) and the camera of each."""
        rotations = camera_from_model[:, :3, :3]
        centres = -np.einsum("pji,pj->pi", rotations, camera_from_model[:, :3, 3])
        return cls(rotations, centres, np.array([camera.edges() for camera in cameras]).reshape(-1, 4))

    def __len__(self) -> int:
        return len(self.centres)

    def in_cameras(self, positions: Array, pictures: Rows) -> Array:
        """Give positions of the model in the frames of the cameras of `pictures`, (..., 3)."""
        apart = positions - self.centres[pictures]
        return np.asarray(np.einsum("...ij,...j->...i", self.rotations[pictures], apart))


@dataclass(frozen=True, eq=False)
class PosedBoxes:
    """All boxes of all pictures, one row a box, in the order of the pictures.

    Attributes
    ----------
    pictures : (B,) int64
        Row of the picture.
    directions : (B, 2) float64
        x and y over z of the fruit's centre, in the camera; NaN where the lens shows an edge of the box from nowhere.
    half_sines : (B, 2) float64
        Of half the angles under which the fruit shows, across and down.
    sigmas : (B,) float64
        Standard deviation of each direction.
    """

    pictures: Rows
    directions: Array
    half_sines: Array
    sigmas: Array

    @classmethod
    def of(cls, boxes_px: Sequence[Array], cameras: Sequence[PictureCamera]) -> PosedBoxes:
        """Take the boxes (D, 4) of each picture, and its camera."""
        found = [_directed(boxes, camera) for boxes, camera in zip(boxes_px, cameras, strict=True)]
        return cls(
            np.repeat(np.arange(len(boxes_px)), [len(boxes) for boxes in boxes_px]).astype(np.int64),
            np.concatenate([np.empty((0, 2)), *(directions for directions, _, _ in found)]),
            np.concatenate([np.empty((0, 2)), *(half_sines for _, half_sines, _ in found)]),
            np.concatenate([np.empty(0), *(sigmas for _, _, sigmas in found)]),
        )

    def __len__(self) -> int:
        return len(self.pictures)

    def select(self, rows: NDArray[np.generic]) -> PosedBoxes:
        """Give some of them."""
        return PosedBoxes(self.pictures[rows], self.directions[rows], self.half_sines[rows], self.sigmas[rows])

    def diameters(self, in_camera: Array, rows: Rows) -> Array:
        """Give the diameters that boxes show of fruits at places in their cameras, (..., 3), by the longer side."""
        across = np.hypot(in_camera[..., 0], in_camera[..., 2]) * self.half_sines[rows, 0]
        down = np.hypot(in_camera[..., 1], in_camera[..., 2]) * self.half_sines[rows, 1]
        return np.asarray(2 * np.maximum(across, down))


def _directed(boxes_px: Array, camera: PictureCamera) -> tuple[Array, Array, Array]:
    xmin, ymin, xmax, ymax = np.asarray(boxes_px, np.float64).reshape(-1, 4).T
    x, y = (xmin + xmax) / 2, (ymin + ymax) / 2
    low = np.arctan(_along(camera, np.stack([xmin, y, x, ymin], axis=1)))
    high = np.arctan(_along(camera, np.stack([xmax, y, x, ymax], axis=1)))
    width, height = xmax - xmin, ymax - ymin
    side = np.maximum(width, height)
    sigmas_px = np.sqrt(EDGE_SIGMA_PX**2 + (SIZE_SIGMA * side) ** 2 + (LACK_SIGMA * np.abs(width - height)) ** 2)
    half_sines = np.sin((high - low) / 2)
    return np.tan((low + high) / 2), half_sines, sigmas_px / float(camera.focal_px.mean())


def _along(camera: PictureCamera, points_px: Array) -> Array:
    """Give x over z of the first point of each row and y over z of the second, (N, 2)."""
    across, down = camera.directions(points_px[:, :2]), camera.directions(points_px[:, 2:])
    return np.stack([across[:, 0], down[:, 1]], axis=1)
