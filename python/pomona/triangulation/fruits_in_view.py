"""Fruits of a reconstruction: posed pictures and boxes to a cloud in the units of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.reconstruction.picture_camera import PictureCamera
from pomona.triangulation.box_tracks import tracks_of_boxes
from pomona.triangulation.many_views import ManyViews, meeting_points, triangulated
from pomona.triangulation.posed_boxes import PosedBoxes, PosedPictures
from pomona.views import Views

__all__ = ["TriangulatedFruits", "triangulated_fruits"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

FARTHEST_OFF = 0.1
"""Standard deviation of a place over its distance: a fruit whose distance is not known to a tenth is left out."""

LEAST_SIGHTS = 2
"""Of a fruit whose boxes are named."""

WHOLE_SHARE = 0.75
"""Of the diameters that the boxes of a fruit show: leaves make boxes smaller, and nothing makes them larger."""

HIDDEN_SIGMA = 0.1
"""Of a place, in diameters: what hides one side of a fruit hides it in many pictures, and no number of them helps."""

SIZE_SIGMA = 0.06
"""Of a diameter, in parts of it, besides what the boxes differ by: edges that leaves hide in all pictures."""


@dataclass(frozen=True, eq=False)
class TriangulatedFruits:
    """Fruits that several pictures show.

    Attributes
    ----------
    cloud : FruitCloud
        In the model, in its units; with diameters, covariances and views. Frames of the views are rows of pictures.
    fruits : (B,) int64
        Row of the fruit of each box, -1 where it is of none, or of where the lens of its picture shows nothing.
    """

    cloud: FruitCloud
    fruits: Rows


def triangulated_fruits(
    camera_from_model: Array,
    cameras: Sequence[PictureCamera],
    boxes_px: Sequence[Array],
    ids: Sequence[tuple[str, ...] | None],
) -> TriangulatedFruits:
    """Find fruits in posed pictures.

    Parameters
    ----------
    camera_from_model : (P, 4, 4) float64
        Poses of the pictures.
    cameras : sequence of P PictureCamera
    boxes_px : sequence of P (D, 4) float64
        Boxes in each picture.
    ids : sequence of P tuples of str, or None
        Names of the boxes: where every box has one, they say which are one fruit. Else the boxes are tracked.
    """
    pictures, boxes = PosedPictures.of(camera_from_model, cameras), PosedBoxes.of(boxes_px, cameras)
    shown = np.flatnonzero(np.isfinite(boxes.directions).all(axis=1))
    found = _of_shown(pictures, boxes.select(shown), _named(boxes_px, ids, shown))
    fruits = np.full(len(boxes), -1, np.int64)
    fruits[shown] = found.fruits
    return TriangulatedFruits(found.cloud, fruits)


def _named(boxes_px: Sequence[Array], ids: Sequence[tuple[str, ...] | None], shown: Rows) -> list[str] | None:
    """Give the names of the boxes `shown`; None unless every box has one."""
    if any(names is None for names, found in zip(ids, boxes_px, strict=True) if len(found)):
        return None
    names = [name for listed in ids for name in listed or ()]
    return [names[row] for row in shown.tolist()]


def _of_shown(pictures: PosedPictures, boxes: PosedBoxes, names: list[str] | None) -> TriangulatedFruits:
    if names:
        labels, named = np.unique(names, return_inverse=True)
        return _cloud(pictures, boxes, named.astype(np.int64), tuple(labels.tolist()))
    fruits = tracks_of_boxes(pictures, boxes)
    return _cloud(pictures, boxes, fruits, tuple(map(str, range(1, int(fruits.max(initial=-1)) + 2))))


def _cloud(pictures: PosedPictures, boxes: PosedBoxes, fruits: Rows, names: tuple[str, ...]) -> TriangulatedFruits:
    """Put tracks at their places, and leave out those that have none."""
    rows = np.flatnonzero(fruits >= 0)
    starts = meeting_points(pictures, boxes, rows, fruits[rows], len(names))
    views = triangulated(pictures, boxes, rows, fruits[rows], starts)
    known = np.bincount(fruits[rows], minlength=len(names)) >= LEAST_SIGHTS
    known &= np.isfinite(views.positions).all(axis=1) & _is_near(pictures, boxes, rows, fruits[rows], views)
    new_row = np.append(np.where(known, np.cumsum(known) - 1, -1), -1)  # boxes of no fruit, -1, take the last
    of_boxes = new_row[fruits]
    rows = np.flatnonzero(of_boxes >= 0)
    positions = views.positions[known]
    sizes, sigmas = _sizes(pictures, boxes, rows, of_boxes[rows], positions)
    covariances = views.covariances[known] + (HIDDEN_SIGMA * sizes)[:, None, None] ** 2 * np.eye(3)
    cloud = FruitCloud(
        positions,
        ids=tuple(name for name, is_known in zip(names, known.tolist(), strict=True) if is_known),
        diameters_m=sizes,
        covariances=(covariances + covariances.transpose(0, 2, 1)) / 2,
        n_views=np.bincount(of_boxes[rows], minlength=len(positions)).astype(np.int64),
        views=Views(boxes.pictures[rows], of_boxes[rows]),
        extras={"diameter_sigma_m": tuple(f"{sigma:.6g}" for sigma in sigmas)},
    )
    return TriangulatedFruits(cloud, of_boxes)


def _is_near(
    pictures: PosedPictures, boxes: PosedBoxes, rows: Rows, fruits: Rows, views: ManyViews
) -> NDArray[np.bool_]:
    """Tell which fruits are as near as their directions can tell."""
    with np.errstate(invalid="ignore"):
        distances = np.linalg.norm(views.positions[fruits] - pictures.centres[boxes.pictures[rows]], axis=1)
        sums = np.bincount(fruits, distances, len(views.positions))
        means = sums / np.maximum(np.bincount(fruits, minlength=len(views.positions)), 1)
        sigmas = np.sqrt(np.maximum(np.trace(views.covariances, axis1=1, axis2=2), 0))
        return np.asarray(sigmas < FARTHEST_OFF * means)


def _sizes(
    pictures: PosedPictures, boxes: PosedBoxes, rows: Rows, fruits: Rows, positions: Array
) -> tuple[Array, Array]:
    """Give the diameter of each fruit and its standard deviation, units of the model."""
    shown = boxes.diameters(pictures.in_cameras(positions[fruits], boxes.pictures[rows]), rows)
    order = np.argsort(fruits, kind="stable")
    groups = np.split(shown[order], np.flatnonzero(np.diff(fruits[order])) + 1) if len(rows) else []
    sizes = np.array([np.quantile(group, WHOLE_SHARE) for group in groups])
    spreads = np.array([group.std() / np.sqrt(len(group)) for group in groups])
    return sizes, np.hypot(spreads, SIZE_SIGMA * sizes)
