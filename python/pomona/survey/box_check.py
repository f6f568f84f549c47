"""What boxes of a scan say of the detector, where they cannot be right: on each other, of halves, of two fruits."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaWarning
from pomona.recording import Calibration
from pomona.survey.part import Boxes, Part

__all__ = ["check_boxes", "check_long_boxes", "check_places_of_boxes", "check_small_boxes"]

Array = NDArray[np.float64]

SAME_BOX = 0.8
"""Area that two boxes share over the area of both together; two fruits of a cluster share half of theirs at most."""

MANY = 0.1
"""Of all boxes; a detector that suppresses such pairs has none, and of halves one in a hundred is by chance."""

AS_WIDE, GAP, OVERLAP, SQUARE = 0.75, 0.25, 0.15, 1.3
"""Halves of a fruit: their common side over that of both, what lies between or is shared over the other side of both,
and how long both together are over how wide."""

LONG, LONGER = 1.5, 1.2
"""Times the median diameter, and times its own width, that a box is long which holds two fruits."""

MANY_LONG = 0.02
"""Of the boxes of fruits. On the rendered rows 0.1 to 0.4 % are as long; where fruits that touch share a box, 5 %."""

ASTRAY = 1.0
"""Sides of a box from its middle to where its fruit lies in the picture, in the median. Of the rendered rows, boxes of
visible parts with names, it is a tenth; with the boxes of another recording 18."""

SEVERAL = 40
"""Boxes below which no share of them is told."""


def check_boxes(path: Path, parts: Sequence[Boxes]) -> None:
    """Warn where many boxes of one frame lie on another one, or are halves: each fruit may count twice."""
    n_boxes = sum(len(boxes.frames) for boxes in parts)
    of_frames = [boxes.boxes_px[boxes.frames == frame] for boxes in parts for frame in dict.fromkeys(boxes.frames)]
    n_twins = _count(_is_twin, of_frames)
    if n_twins > MANY * n_boxes:
        found = (
            f"{n_twins} of {n_boxes} boxes share {SAME_BOX:.0%} or more of their area with another one of their frame"
        )
        advice = "suppress such pairs, with the model's --iou or in the program that wrote them"
        warnings.warn(f"{path}: {found}: {advice}", PomonaWarning, stacklevel=3)
    n_halves = _count(_is_half, of_frames)
    if n_boxes >= SEVERAL and n_halves > MANY * n_boxes:
        found = f"{n_halves} of {n_boxes} boxes make one square with the box beside them, as halves of a fruit do"
        warnings.warn(f"{path}: {found}: join the boxes of one fruit", PomonaWarning, stacklevel=3)


def check_small_boxes(path: Path, parts: Sequence[Boxes], least_px: float) -> None:
    """Warn where boxes are so small that a detector misses many fruits; what it finds are the larger ones."""
    sides_px = np.concatenate([np.sqrt(np.prod(each.boxes_px[:, 2:] - each.boxes_px[:, :2], axis=1)) for each in parts])
    if len(sides_px) >= SEVERAL and (median_px := float(np.median(sides_px))) < least_px:
        found = f"boxes are {median_px:.0f} px wide in the median, expected {least_px:g} or more"
        advice = "of smaller fruits the detector misses a fifth and more, the smaller ones: film nearer"
        warnings.warn(f"{path}: {found}: {advice}", PomonaWarning, stacklevel=3)


def check_long_boxes(path: Path, calibration: Calibration, parts: Iterable[Part]) -> None:
    """Warn where many boxes are as long as two fruits of the row: fruits that touch count once."""
    longs = np.concatenate([np.zeros(0, bool), *(_is_long(part, calibration) for part in parts)])
    if len(longs) >= SEVERAL and longs.sum() > MANY_LONG * len(longs):
        found = f"{longs.sum()} of {len(longs)} boxes of fruits are long as two of them and not as wide"
        advice = "give each fruit its box, with a higher --iou of the model or in the program that wrote them"
        warnings.warn(f"{path}: {found}: {advice}", PomonaWarning, stacklevel=3)


def check_places_of_boxes(path: Path, calibration: Calibration, parts: Iterable[Part]) -> bool:
    """Warn where boxes lie far from where their fruits are: names may join what is none, as in another recording.

    Returns whether something was said.
    """
    away = np.concatenate([np.zeros(0), *(_sides_away(part, calibration) for part in parts)])
    if len(away) < SEVERAL or not (sides := float(np.nanmedian(away))) > ASTRAY:
        return False
    found = f"boxes are {sides:.1f} times their size from where their fruits lie, in the median, expected a tenth"
    advice = "they are of another recording, of other frames, or not named fruit by fruit"
    warnings.warn(f"{path}: {found}: {advice}", PomonaWarning, stacklevel=3)
    return True


def _count(is_so: Callable[[Array, Array], NDArray[np.bool_]], of_frames: Sequence[Array]) -> int:
    """Count boxes that are so with another one of their frame; corners of both, (D, 1, 4) and (1, D, 4)."""
    count = 0
    for boxes_px in of_frames:
        pairs = is_so(boxes_px[:, None], boxes_px[None])
        np.fill_diagonal(pairs, False)
        count += int(pairs.any(axis=1).sum())
    return count


def _common(one: Array, other: Array) -> Array:
    """Width and height that two boxes share, below 0 how far they lie apart."""
    return np.asarray(np.minimum(one[..., 2:], other[..., 2:]) - np.maximum(one[..., :2], other[..., :2]))


def _is_twin(one: Array, other: Array) -> NDArray[np.bool_]:
    common = np.clip(_common(one, other), 0, None).prod(axis=-1)
    areas = [(box[..., 2:] - box[..., :2]).prod(axis=-1) for box in (one, other)]
    return np.asarray(common >= SAME_BOX * (areas[0] + areas[1] - common))


def _is_half(one: Array, other: Array) -> NDArray[np.bool_]:
    both = np.maximum(one[..., 2:], other[..., 2:]) - np.minimum(one[..., :2], other[..., :2])
    share = _common(one, other) / both
    square = both.max(axis=-1) <= SQUARE * both.min(axis=-1)
    beside = (share >= AS_WIDE) & (share[..., ::-1] >= -GAP) & (share[..., ::-1] <= OVERLAP)
    return np.asarray(square & beside.any(axis=-1))


def _is_long(part: Part, calibration: Calibration) -> NDArray[np.bool_]:
    """Whether each box of a fruit is as long as two, (B,)."""
    boxes_px, fruits, in_camera = _of_fruits(part)
    if part.cloud.diameters_m is None or not len(fruits):
        return np.zeros(0, bool)
    sides_m = (boxes_px[:, 2:] - boxes_px[:, :2]) * in_camera[:, 2:] / (calibration.fx, calibration.fy)
    longer_m, shorter_m = sides_m.max(axis=1), sides_m.min(axis=1)
    long_m = LONG * np.nanmedian(part.cloud.diameters_m)
    return np.asarray((longer_m > long_m) & (longer_m > LONGER * shorter_m))


def _sides_away(part: Part, calibration: Calibration) -> Array:
    """Distance of the middle of each box of a fruit from where that lies, over the box's side, (B,)."""
    boxes_px, _, in_camera = _of_fruits(part)
    with np.errstate(all="ignore"):
        ahead = in_camera[:, :2] / in_camera[:, 2:]
        off_px = (
            ahead * (calibration.fx, calibration.fy)
            + (calibration.cx, calibration.cy)
            - (boxes_px[:, :2] + boxes_px[:, 2:]) / 2
        )
        return np.asarray(np.linalg.norm(off_px, axis=1) / np.sqrt((boxes_px[:, 2:] - boxes_px[:, :2]).prod(axis=1)))


def _of_fruits(part: Part) -> tuple[Array, NDArray[np.int64], Array]:
    """Give boxes that are of a fruit, (B, 4), their fruits, and where these are in the camera of the frame, (B, 3)."""
    boxes = part.boxes
    rows = np.flatnonzero(boxes.fruits >= 0)
    row_of = {int(frame): row for row, frame in enumerate(part.trajectory.frames)}
    poses = part.trajectory.session_from_camera[[row_of[int(frame)] for frame in boxes.frames[rows]]]
    away = part.cloud.positions[boxes.fruits[rows]] - poses[:, :3, 3]
    return boxes.boxes_px[rows], boxes.fruits[rows], np.einsum("bij,bi->bj", poses[:, :3, :3], away)
