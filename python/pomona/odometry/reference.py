"""A keyframe that later pictures are compared with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.odometry.features import corners, follow
from pomona.odometry.patches import rematch
from pomona.odometry.window import SIGMA_PX, Camera, triangulated

__all__ = ["Found", "Measure", "Reference"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]

Measure = Callable[[Array, Array], Array]
"""Gives the disparities (N,) of picture points (N, 2), from what is expected (N,), NaN for unknown; NaN for none."""

ENOUGH_INLIERS = 60
"""Points below which those that were not found are looked for again where the found pose shows them."""

NEAREST_M = 0.1
"""What is nearer than this is not in focus."""

DENSE_PER_CELL = 12
"""Corners of a cell where points are found again by patches: a third can be measured, a tenth of those match."""


@dataclass(frozen=True, eq=False)
class Found:
    """A pose, and the points of the reference that agree with it.

    Attributes
    ----------
    pose : (4, 4)
        `session_from_camera`.
    information : (6, 6)
        Inverse covariance of its step (translation, rotation).
    agrees : (N,) bool
        Which points of the reference agree.
    places : (N, 2)
        Where the picture shows them.
    followed : int
        Points that were found at all.
    """

    pose: Array
    information: Array
    agrees: Mask
    places: Array
    followed: int

    @property
    def inliers(self) -> int:
        """How many agree."""
        return int(self.agrees.sum())


@dataclass(frozen=True, eq=False)
class Reference:
    """The picture of a keyframe, the points that it sees, and what is known of them.

    Attributes
    ----------
    measure : callable
        Gives disparities in this picture.
    pose : (4, 4)
        `session_from_camera`.
    numbers : (N,) int64
        Of the points in the window.
    places : (N, 2)
        Where the picture shows them.
    positions, covariances : (N, 3), (N, 3, 3)
        In the frame of reference of the part.
    """

    camera: Camera
    picture: Picture
    measure: Measure
    pose: Array
    numbers: NDArray[np.int64]
    places: Array
    positions: Array
    covariances: Array

    def locate(self, picture: Picture, expected: Array) -> Found | None:
        """Follow the points to a picture, twice if need be, and take the pose on which they agree."""
        places = np.zeros((len(self.numbers), 2))
        kept = self.follow(picture, expected, np.ones(len(places), bool), places)
        found = self._consensus(places, kept, expected)
        if found is None or found.inliers >= ENOUGH_INLIERS:
            return found
        again = self.follow(picture, found.pose, ~found.agrees, places)
        return self._consensus(places, found.agrees | again, found.pose) or found

    def follow(self, picture: Picture, expected: Array, wanted: Mask, places: Array) -> Mask:
        """Write where the picture shows the wanted points, and say which were found."""
        guess, ahead = self.project(expected)
        height, width = picture.shape
        ahead &= wanted & (guess > 0).all(axis=1) & (guess < (width, height)).all(axis=1)
        rows = np.flatnonzero(ahead)
        places[rows], came_home = follow(self.picture, picture, self.places[rows], guess[rows])
        found = np.zeros(len(places), bool)
        found[rows[came_home]] = True
        return found

    def project(self, pose: Array) -> tuple[Array, Mask]:
        """Picture places (N, 2) of the points from another pose, and which lie ahead."""
        fx, fy, cx, cy = self.camera.fx, self.camera.fy, self.camera.cx, self.camera.cy
        in_camera = (self.positions - pose[:3, 3]) @ pose[:3, :3]
        ahead = np.asarray(in_camera[:, 2] > NEAREST_M, bool)
        x, y, z = np.where(ahead[:, None], in_camera, 1.0).T
        return np.stack([fx * x / z + cx, fy * y / z + cy], axis=1), ahead

    def find_again(self, picture: Picture, expected: Array) -> Array | None:
        """Find the pose of a picture that may show the points anywhere, by patches; slow."""
        none = np.zeros((0, 2))
        places = corners(self.picture, none, DENSE_PER_CELL)
        disparity = self.measure(places, np.full(len(places), np.nan))
        known = np.isfinite(disparity)
        candidates = corners(picture, none, DENSE_PER_CELL)
        there, matched = rematch(self.picture, picture, places[known], candidates)
        in_camera, covariances = triangulated(self.camera, np.column_stack([places[known], disparity[known]])[matched])
        here = np.linalg.inv(self.pose) @ expected
        located = _core.locate(self.camera, in_camera, covariances, there[matched], here, sigma_px=MATCH_SIGMA_PX)
        return None if located is None else np.asarray(self.pose @ located[0], np.float64)

    def _consensus(self, places: Array, matched: Mask, expected: Array) -> Found | None:
        rows = np.flatnonzero(matched)
        located = _core.locate(
            self.camera,
            self.positions[rows],
            self.covariances[rows],
            places[rows],
            expected,
            sigma_px=SIGMA_PX,
        )
        if located is None:
            return None
        pose, information, inliers = located
        agrees = np.zeros(len(matched), bool)
        agrees[rows[inliers]] = True
        return Found(pose, information, agrees, places.copy(), len(rows))


MATCH_SIGMA_PX = 1.0
"""Standard deviation of patches matched at corners, which are whole pixels on both sides."""
