"""Where two boxes might be one fruit.

Two boxes propose a place where their directions meet within their sigmas (the epipolar distance), in front of both
cameras, with one size. Each place is judged by a ladder of neighbouring pictures that should show it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pomona.triangulation.box_evidence import GATE, SIZE_RATIO_SIGMA, BoxEvidence
from pomona.triangulation.hypotheses import Hypotheses
from pomona.triangulation.many_views import projected
from pomona.triangulation.neighbouring_pictures import neighbours_of
from pomona.triangulation.posed_boxes import PosedBoxes, PosedPictures

__all__ = ["hypotheses_of"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

LEAST_PARALLAX = 6.0
"""Angle between two directions in sigmas of one: below, the distance is known to no better than a fourth."""

KEPT_PER_BOX = 4
"""Hypotheses of each box that are looked at again."""


def hypotheses_of(judge: BoxEvidence, first_box: Rows, row: int) -> Hypotheses:
    """Propose places for the boxes of one picture; `first_box` (P + 1,) says where the boxes of each begin."""
    pictures, boxes = judge.pictures, judge.boxes
    ladder = neighbours_of(pictures, row)
    proposed = [_of_two(pictures, boxes, first_box, row, int(other)) for other in ladder]
    if not proposed:
        return _none()
    all_ = Hypotheses(
        np.concatenate([one.boxes for one in proposed]),
        np.concatenate([one.positions for one in proposed]),
        np.concatenate([one.covariances for one in proposed]),
        np.concatenate([one.diameters for one in proposed]),
        np.zeros(sum(len(one.evidence) for one in proposed)),
    )
    evidence = all_.evidence
    places = np.arange(len(evidence))
    for other in ladder.tolist():
        evidence = evidence + judge(all_, places, np.full(len(places), other)).gains
    return _best_of_each(replace(all_, evidence=evidence, n_proposed=len(evidence)))


def _none() -> Hypotheses:
    return Hypotheses(np.empty((0, 2), np.int64), np.empty((0, 3)), np.empty((0, 3, 3)), np.empty(0), np.empty(0))


def _best_of_each(all_: Hypotheses) -> Hypotheses:
    order = np.lexsort((-all_.evidence, all_.boxes[:, 0]))
    anchors = all_.boxes[order, 0]
    begins = np.searchsorted(anchors, anchors)
    kept = order[(np.arange(len(order)) - begins < KEPT_PER_BOX) & (all_.evidence[order] > 0)]
    return all_.select(kept)


def _of_two(pictures: PosedPictures, boxes: PosedBoxes, first_box: Rows, one: int, other: int) -> Hypotheses:
    """Propose places where boxes of two pictures meet."""
    mine = np.arange(first_box[one], first_box[one + 1])
    theirs = np.arange(first_box[other], first_box[other + 1])
    rows = _meeting(pictures, boxes, mine, theirs, one, other)
    rays = [_rays(pictures, boxes, rows[:, side], picture) for side, picture in enumerate((one, other))]
    apart = pictures.centres[other] - pictures.centres[one]
    places, parallax = _midpoints(pictures.centres[one], apart, *rays)
    in_cameras = [pictures.in_cameras(places, np.full(len(rows), picture)) for picture in (one, other)]
    sizes = [boxes.diameters(in_camera, rows[:, side]) for side, in_camera in enumerate(in_cameras)]
    sigmas = np.maximum(*(boxes.sigmas[rows[:, side]] for side in range(2)))
    with np.errstate(divide="ignore", invalid="ignore"):
        alike = np.abs(np.log(sizes[0] / sizes[1])) < GATE * SIZE_RATIO_SIGMA
    fine = (in_cameras[0][:, 2] > 0) & (in_cameras[1][:, 2] > 0) & alike & (parallax > LEAST_PARALLAX * sigmas)
    information = _information(pictures, boxes, rows[fine, 0], in_cameras[0][fine], one)
    information = information + _information(pictures, boxes, rows[fine, 1], in_cameras[1][fine], other)
    diameters = np.sqrt(sizes[0][fine] * sizes[1][fine])
    return Hypotheses(rows[fine], places[fine], np.asarray(np.linalg.inv(information)), diameters, np.zeros(fine.sum()))


def _meeting(pictures: PosedPictures, boxes: PosedBoxes, mine: Rows, theirs: Rows, one: int, other: int) -> Rows:
    """Give pairs of rows whose directions meet within `GATE` sigmas: |x'Ex| over its sigma (Sampson, 1982)."""
    other_from_one = pictures.rotations[other] @ pictures.rotations[one].T
    x, y, z = pictures.rotations[other] @ (pictures.centres[one] - pictures.centres[other])
    essential = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ other_from_one
    here, there = (np.pad(boxes.directions[rows], ((0, 0), (0, 1)), constant_values=1.0) for rows in (mine, theirs))
    lines_there, lines_here = here @ essential.T, there @ essential
    errors = lines_there @ there.T
    variances = (boxes.sigmas[mine] ** 2)[:, None] * (lines_here[:, :2] ** 2).sum(axis=1)[None, :]
    variances = variances + (boxes.sigmas[theirs] ** 2)[None, :] * (lines_there[:, :2] ** 2).sum(axis=1)[:, None]
    first, second = np.nonzero(errors**2 < GATE**2 * variances)
    return np.stack([mine[first], theirs[second]], axis=1)


def _rays(pictures: PosedPictures, boxes: PosedBoxes, rows: Rows, picture: int) -> Array:
    rays = np.pad(boxes.directions[rows], ((0, 0), (0, 1)), constant_values=1.0) @ pictures.rotations[picture]
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _midpoints(centre: Array, apart: Array, first: Array, second: Array) -> tuple[Array, Array]:
    """Give the middle between two rays where they are nearest, and the sine of the angle between them."""
    cosines = (first * second).sum(axis=1)
    sines2 = np.maximum(1 - cosines**2, np.finfo(np.float64).eps)
    along_first, along_second = first @ apart, second @ apart
    on_first = (along_first - cosines * along_second) / sines2
    on_second = (cosines * along_first - along_second) / sines2
    middles = (on_first[:, None] * first + apart + on_second[:, None] * second) / 2
    return centre + middles, np.sqrt(sines2)


def _information(pictures: PosedPictures, boxes: PosedBoxes, rows: Rows, in_camera: Array, picture: int) -> Array:
    _, slopes = projected(in_camera)
    slopes = slopes @ pictures.rotations[picture] / boxes.sigmas[rows][:, None, None]
    information = np.asarray(np.einsum("hki,hkj->hij", slopes, slopes))
    return np.asarray(information + 1e-12 * np.trace(information, axis1=1, axis2=2)[:, None, None] * np.eye(3))
