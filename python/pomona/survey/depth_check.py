"""Whether pictures of depth are those of the colour pictures: fruits are round in both, at one place.

Within a box a fruit is one surface, as deep as it is wide. Where depth is of another view, as of a camera whose
pictures were not registered to each other, of another frame or another angle of view, boxes hold leaves and gaps too.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaWarning
from pomona.recording import Calibration, Recording
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey.part import Boxes
from pomona.survey.sampled_boxes import frames_in_words, sampled_boxes

__all__ = ["check_depth_pictures"]

MOST_BOXES = 100
"""Of those of a few frames, evenly, that are looked at."""

SOME = 20
"""Boxes with depth in them below which nothing is said."""

INNER, LEAST_PIXELS = 0.7, 5
"""Part of a box, each way, that a fruit fills, and pixels with depth in it that say something."""

MOVED_PX, STEP_PX = (48, 24), 6
"""To the sides, and up and down, by which depth is tried."""

SIZES = (0.75, 0.8, 0.9, 1.1, 1.2, 1.33)
"""Of the depth pictures about the principal point that are tried."""

FRAMES_AWAY = (-2, -1, 1, 2)

BETTER = 0.15
"""Of the pixels, by which more are of one surface where depth is tried than as it is. In recordings with holes, noise
of 15 mm, steps of 40 mm and flying pixels it is nowhere better; moved, larger, or a frame late it is by .2 and more."""

Box = NDArray[np.float64]
Depth = NDArray[np.float32]


def check_depth_pictures(recording: Recording, parts: Sequence[Boxes]) -> None:
    """Warn where the boxes fit the pictures of depth elsewhere than where they are."""
    if "depth" not in recording.description()["pictures"]:
        return
    boxes_of = sampled_boxes(parts)
    step = max(sum(map(len, boxes_of.values())) // MOST_BOXES, 1)
    boxes_of = {frame: boxes_px[::step] for frame, boxes_px in boxes_of.items()}
    depths = _depths(recording, {frame: frame for frame in boxes_of})
    own = _of_one_surface(depths, boxes_of, recording.calibration)
    if own is None:
        return
    tried = [
        *_tried_moved(depths, boxes_of, recording.calibration),
        *_tried_in_time(recording, boxes_of),
    ]
    best, words = max(tried, key=lambda one: one[0])
    if best > own + BETTER:
        found = f"the fruits of the colour pictures are in the depth pictures {words}"
        advice = "register the depth pictures to the colour ones"
        warnings.warn(f"{recording.path}: {found}: {advice}", PomonaWarning, stacklevel=3)


def _tried_moved(
    depths: dict[int, Depth], boxes_of: dict[int, Box], calibration: Calibration
) -> list[tuple[float, str]]:
    """Move and size the boxes; give the share that is of one surface then, and what is said of it."""
    centre = np.tile([calibration.cx, calibration.cy], 2)
    columns, rows = (np.arange(-most, most + 1, STEP_PX) for most in MOVED_PX)

    def share(change: Callable[[Box], Box]) -> float:
        changed = {frame: change(boxes_px) for frame, boxes_px in boxes_of.items()}
        return _of_one_surface(depths, changed, calibration) or 0.0

    moved = [
        (share(partial(np.add, (x, y, x, y))), _moved_as_text(x, y))
        for x in columns.tolist()
        for y in rows.tolist()
        if x or y
    ]
    sized = [(share(partial(_sized, centre, size)), f"{size:.2g} times as large") for size in SIZES]
    return moved + sized


def _sized(centre: Box, size: float, boxes_px: Box) -> Box:
    return np.asarray(centre + size * (boxes_px - centre), np.float64)


def _tried_in_time(recording: Recording, boxes_of: dict[int, Box]) -> list[tuple[float, str]]:
    """Look at the depth of frames before and after instead."""
    row_of = {number: row for row, number in enumerate(recording.numbers)}
    found = []
    for away in FRAMES_AWAY:
        rows = {frame: row_of[frame] + away for frame in boxes_of if 0 <= row_of[frame] + away < len(recording)}
        depths = _depths(recording, {frame: recording.numbers[row] for frame, row in rows.items()})
        share = _of_one_surface(depths, boxes_of, recording.calibration) or 0.0
        found.append((share, f"{frames_in_words(away)} {'earlier' if away < 0 else 'later'}"))
    return found


def _moved_as_text(x_px: int, y_px: int) -> str:
    across = [f"{abs(x_px)} px to the {'right' if x_px > 0 else 'left'}"] if x_px else []
    down = [f"{abs(y_px)} px {'lower' if y_px > 0 else 'higher'}"] if y_px else []
    return " and ".join(across + down)


def _depths(recording: Recording, taken_for: dict[int, int]) -> dict[int, Depth]:
    """Read the depth of frames for those that they are taken for; those that cannot be read are left out."""
    frames_for: dict[int, list[int]] = {}
    for frame, taken in taken_for.items():
        frames_for.setdefault(taken, []).append(frame)
    depths: dict[int, Depth] = {}
    for shown in recording.frames(set(frames_for)):
        try:
            depth = None if shown.read_depth is None else shown.read_depth()
        except UnreadablePictureError:
            continue
        if depth is not None:
            depths |= dict.fromkeys(frames_for[shown.number], depth)
    return depths


def _of_one_surface(depths: dict[int, Depth], boxes_of: dict[int, Box], calibration: Calibration) -> float | None:
    """Give the mean share of the pixels of a box that are as deep as a fruit of its size; None of too few boxes."""
    shares = [
        share
        for frame, depth in depths.items()
        for box in boxes_of[frame]
        if (share := _share(depth, box, calibration.fx)) is not None
    ]
    return float(np.mean(shares)) if len(shares) >= SOME else None


def _share(depth_m: Depth, box: Box, focal_px: float) -> float | None:
    """Give the share of the pixels with depth in the middle of a box that lie within its radius of their median."""
    middle, half = (box[:2] + box[2:]) / 2, (box[2:] - box[:2]) / 2
    (left, top), (right, bottom) = (middle - INNER * half).astype(int), (middle + INNER * half).astype(int) + 1
    if left < 0 or top < 0 or right > depth_m.shape[1] or bottom > depth_m.shape[0]:
        return None
    inside = depth_m[top:bottom, left:right]
    known = inside[inside > 0]
    if len(known) < LEAST_PIXELS:
        return None
    median_m = float(np.median(known))
    return float((np.abs(known - median_m) < half.max() / focal_px * median_m).mean())
