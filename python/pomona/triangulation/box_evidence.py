"""What the boxes of pictures say of places where fruits might be.

A fruit in view has a box with probability `SEEN`, near where it is expected and of its size; strangers lie anywhere in
the picture. Only boxes that lie near a place are compared with it: all with all would grow with the cube of how many
fruits a picture shows, because places do with the square.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.triangulation.hypotheses import Hypotheses
from pomona.triangulation.many_views import projected
from pomona.triangulation.posed_boxes import PosedBoxes, PosedPictures

__all__ = ["GATE", "SIZE_RATIO_SIGMA", "BoxEvidence", "Heard"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Mask = NDArray[np.bool_]

GATE = 3.0
"""Sigmas between two directions that may meet."""

SIZE_RATIO_SIGMA = 0.25
"""Of the logarithm of two diameters of one fruit: leaves hide a part of it."""

SIZE_SPREAD = 0.7
"""Of the logarithm of the diameters of strangers, which mostly are at wrong distances."""

SEEN = 0.6
"""Probability that a fruit in view has a box; the others are behind leaves."""

MISSED = float(np.log(1 - SEEN))

SLACK = 1e-9
"""Of where boxes are looked for, in parts of what their directions reach over: rounding loses none at the edge."""


@dataclass(frozen=True, eq=False)
class Heard:
    """What was said of L looks at places.

    Attributes
    ----------
    gains : (L,) float64
        For a fruit against chance, nats; 0 where the place is out of view.
    boxes : (L,) int64
        Row of the box that speaks, else -1.
    """

    gains: Array
    boxes: Rows


class BoxEvidence:
    """Judge of places: pictures and their boxes.

    Attributes
    ----------
    pictures : PosedPictures
    boxes : PosedBoxes
    """

    def __init__(self, pictures: PosedPictures, boxes: PosedBoxes) -> None:
        self.pictures, self.boxes = pictures, boxes
        across = boxes.directions[:, 0]
        self._low, self._high = float(across.min(initial=0.0)), float(across.max(initial=0.0))
        keys = self._keys(boxes.pictures, across)
        self._order = np.argsort(keys, kind="stable")
        self._sorted_keys = keys[self._order]
        self._widest = np.zeros(len(pictures))
        np.maximum.at(self._widest, boxes.pictures, boxes.sigmas)
        self._areas = np.prod(pictures.corners[:, 2:] - pictures.corners[:, :2], axis=1)

    def __call__(self, places: Hypotheses, rows: Rows, pictures: Rows, is_left: Mask | None = None) -> Heard:
        """Ask pictures (L,) for places, rows (L,) of them, of the boxes that are left, (B,), else of all."""
        in_camera = self.pictures.in_cameras(places.positions[rows], pictures)
        seen, slopes = projected(in_camera)
        heard = Heard(np.zeros(len(rows)), np.full(len(rows), -1, np.int64))
        visible = np.flatnonzero(_is_in_view(self.pictures, seen, in_camera, pictures))
        heard.gains[visible] = MISSED
        slopes = slopes[visible] @ self.pictures.rotations[pictures[visible]]
        spread = slopes @ places.covariances[rows[visible]] @ slopes.transpose(0, 2, 1)
        looks, boxes = self._near(pictures[visible], seen[visible], spread, is_left)
        near = self._nearness(boxes, seen[visible[looks]], spread[looks])
        near = near - self._backgrounds(is_left)[pictures[visible[looks]]] + np.log(SEEN)
        near += _likeness(
            self.boxes.diameters(in_camera[visible[looks]], boxes), places.diameters[rows[visible[looks]]]
        )
        order = np.lexsort((boxes, -near, looks))
        _, first = np.unique(looks[order], return_index=True)
        best = order[first]
        best = best[near[best] > MISSED]
        heard.gains[visible[looks[best]]], heard.boxes[visible[looks[best]]] = near[best], boxes[best]
        return heard

    def _keys(self, pictures: Rows, across: Array) -> Array:
        """Give numbers that grow with the picture, and in a picture with x over z."""
        reach = self._high - self._low + 1.0
        return np.asarray(pictures * reach + np.clip(across, self._low, self._high))

    def _near(self, pictures: Rows, expected: Array, spread: Array, is_left: Mask | None) -> tuple[Rows, Rows]:
        """Give the looks and the boxes that may be within `GATE` sigmas of each other, by x over z alone."""
        reach = GATE * np.sqrt(spread[:, 0, 0] + self._widest[pictures] ** 2) + SLACK * len(self.pictures)
        first = np.searchsorted(self._sorted_keys, self._keys(pictures, expected[:, 0] - reach), "left")
        last = np.searchsorted(self._sorted_keys, self._keys(pictures, expected[:, 0] + reach), "right")
        counts = np.maximum(last - first, 0)
        looks = np.repeat(np.arange(len(pictures)), counts)
        boxes = self._order[np.arange(len(looks)) + np.repeat(first - np.cumsum(counts) + counts, counts)]
        apart = self.boxes.directions[boxes] - expected[looks]
        variances = spread[looks].diagonal(axis1=1, axis2=2) + self.boxes.sigmas[boxes, None] ** 2
        kept = (apart**2 < (GATE**2 + SLACK) * variances).all(axis=1)
        kept &= True if is_left is None else is_left[boxes]
        return looks[kept], boxes[kept]

    def _nearness(self, boxes: Rows, expected: Array, spread: Array) -> Array:
        """Logarithm of the density of boxes around where places (N, 2), with spread (N, 2, 2), are expected."""
        x, y = (self.boxes.directions[boxes] - expected).T
        variances = self.boxes.sigmas[boxes] ** 2
        xx, xy, yy = spread[:, 0, 0] + variances, spread[:, 0, 1], spread[:, 1, 1] + variances
        determinants = xx * yy - xy**2
        squared = (yy * x**2 - 2 * xy * x * y + xx * y**2) / determinants
        return np.where(squared < GATE**2, -squared / 2 - np.log(2 * np.pi * np.sqrt(determinants)), -np.inf)

    def _backgrounds(self, is_left: Mask | None) -> Array:
        """Logarithm of the density of boxes that lie anywhere, of each picture."""
        of = self.boxes.pictures if is_left is None else self.boxes.pictures[is_left]
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(np.bincount(of, minlength=len(self.pictures)) / self._areas))


def _is_in_view(pictures: PosedPictures, seen: Array, in_camera: Array, picture: Rows) -> NDArray[np.bool_]:
    """Tell which places show in a picture, by their x and y over z there."""
    low, high = pictures.corners[picture, :2], pictures.corners[picture, 2:]
    return np.asarray((in_camera[..., 2] > 0) & (seen > low).all(axis=-1) & (seen < high).all(axis=-1))


def _likeness(shown: Array, diameters: Array) -> Array:
    """Logarithm of how much likelier a size is of the fruit than of a stranger."""
    ratios = np.log(np.maximum(shown, np.finfo(np.float64).tiny) / diameters)
    return np.asarray(
        ratios**2 * (1 / SIZE_SPREAD**2 - 1 / SIZE_RATIO_SIGMA**2) / 2 + np.log(SIZE_SPREAD / SIZE_RATIO_SIGMA)
    )
