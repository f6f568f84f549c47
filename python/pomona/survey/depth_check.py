"""Whether pictures of depth are those of the colour pictures: fruits are round in both, at one place.

Within a box a fruit is one surface, as deep as it is wide. Where depth is of another view, as of a camera whose
pictures were not registered to each other, of another frame or another angle of view, boxes hold leaves and gaps too.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pomona.detect.opening import open_detector
from pomona.errors import PomonaWarning
from pomona.recording import Calibration, Recording
from pomona.recording.boxes_beside import boxes_beside
from pomona.recording.checks.along_rays import depth_along_rays
from pomona.recording.evenly import evenly
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey.depth_metres import fault_of_metres
from pomona.survey.part import Boxes
from pomona.survey.sampled_boxes import LOOKED_AT, Pixels, frames_in_words, sampled_boxes

__all__ = ["check_depth_pictures", "fault_of_depth"]

MOST_BOXES = 100
"""Of those of a few frames, evenly, that are looked at."""

SOME = 20
"""Boxes with depth in them below which nothing is said."""

INNER, PLACES, LEAST_PLACES = 0.7, 7, 5
"""Part of a box, each way, that a fruit fills, so many places along it and across it at which depth is looked up, and
those with depth that say something."""

MOVED_PX, STEP_PX, SIZED_STEP_PX = (48, 24), 6, 12
"""To the sides, and up and down, by which depth is tried; up and down in larger steps where it has another size."""

SIZES = (0.75, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.16, 1.24, 1.33)
"""Of the depth pictures about the principal point that are tried, each with every move: a camera beside the colour one
mostly has another angle of view, too, and then neither alone fits better by much. Steps of 6 % move what is at the
sides of a picture of 640 by half an apple."""

FRAMES_AWAY = (-2, -1, 1, 2)

BETTER = 0.15
"""Of the pixels, by which more are of one surface where depth is tried than as it is. In recordings with holes, noise
of 15 mm, steps of 40 mm and flying pixels it is nowhere better; moved, larger, or a frame late it is by .2 and more."""

SURE = 3.0
"""Standard deviations by which it must be better, too: of few boxes, some of the many places fit by chance."""

Depth = NDArray[np.float32]
Share = tuple[float, float]
"""Mean over boxes of the part that is of one surface, and its variance."""


def check_depth_pictures(recording: Recording, parts: Sequence[Boxes]) -> bool:
    """Warn where the boxes fit the pictures of depth elsewhere than where they are, or these hold no metres or depths.

    Returns whether something was said.
    """
    if (found := _fault(recording, sampled_boxes(parts)) or depth_along_rays(recording)) is not None:
        warnings.warn(f"{recording.path}: {found}", PomonaWarning, stacklevel=3)
    return found is not None


def fault_of_depth(recording: Recording) -> str | None:
    """Say where boxes that came with a recording fit the pictures of depth instead, or that these hold no depths."""
    return _by_boxes_beside(recording) or depth_along_rays(recording)


def _by_boxes_beside(recording: Recording) -> str | None:
    if boxes_beside(recording.path) is None:
        return None
    boxes_of = open_detector(None, None, recording)
    frames = recording.frames({recording.numbers[row] for row in evenly(len(recording), LOOKED_AT)})
    return _fault(recording, {frame.number: boxes_of(frame).boxes_px for frame in frames})


def _fault(recording: Recording, boxes_of: dict[int, Pixels]) -> str | None:
    """Say why the boxes of some frames and the pictures of depth are not of the same fruits, and what to do."""
    if "depth" not in recording.description()["pictures"]:
        return None
    step = max(sum(map(len, boxes_of.values())) // MOST_BOXES, 1)
    boxes_of = {frame: boxes_px[::step] for frame, boxes_px in boxes_of.items()}
    depths = _depths(recording, {frame: frame for frame in boxes_of})
    if (found := fault_of_metres(depths, boxes_of, recording.calibration)) is not None:
        return found
    own = _of_one_surface(depths, boxes_of, recording.calibration)
    if own is None:
        return None
    tried = [
        *_tried_moved(depths, boxes_of, recording.calibration),
        *_tried_in_time(recording, boxes_of),
    ]
    (best, variance), words = max(tried, key=lambda one: one[0])
    if best <= own[0] + max(BETTER, SURE * np.sqrt(own[1] + variance)):
        return None
    advice = "register the depth pictures to the colour ones"
    return f"the fruits of the colour pictures are in the depth pictures {words}: {advice}"


def _tried_moved(
    depths: dict[int, Depth], boxes_of: dict[int, Pixels], calibration: Calibration
) -> list[tuple[Share, str]]:
    """Size and move the boxes; give the share that is of one surface then, and what is said of it."""
    centre = np.tile([calibration.cx, calibration.cy], 2)
    tried = []
    for size in (1.0, *SIZES):
        columns, rows = _steps(MOVED_PX[0], STEP_PX), _steps(MOVED_PX[1], STEP_PX if size == 1 else SIZED_STEP_PX)
        sized = {frame: _sized(centre, size, boxes_px) for frame, boxes_px in boxes_of.items()}
        for x, y in product(columns, rows):
            changed = {frame: np.add(boxes_px, (x, y, x, y)) for frame, boxes_px in sized.items()}
            share = _of_one_surface(depths, changed, calibration)
            if share is not None and (size, x, y) != (1.0, 0, 0):
                tried.append((share, _moved_as_text(size, x, y)))
    return tried


def _steps(most_px: int, step_px: int) -> list[int]:
    return list(range(-most_px, most_px + 1, step_px))


def _sized(centre: Pixels, size: float, boxes_px: Pixels) -> Pixels:
    return np.asarray(centre + size * (boxes_px - centre), np.float64)


def _tried_in_time(recording: Recording, boxes_of: dict[int, Pixels]) -> list[tuple[Share, str]]:
    """Look at the depth of frames before and after instead."""
    row_of = {number: row for row, number in enumerate(recording.numbers)}
    found = []
    for away in FRAMES_AWAY:
        rows = {frame: row_of[frame] + away for frame in boxes_of if 0 <= row_of[frame] + away < len(recording)}
        depths = _depths(recording, {frame: recording.numbers[row] for frame, row in rows.items()})
        share = _of_one_surface(depths, boxes_of, recording.calibration)
        if share is not None:
            found.append((share, f"{frames_in_words(away)} {'earlier' if away < 0 else 'later'}"))
    return found


def _moved_as_text(size: float, x_px: int, y_px: int) -> str:
    sized = [f"{size:.2g} times as large"] if size != 1 else []
    across = [f"{abs(x_px)} px to the {'right' if x_px > 0 else 'left'}"] if x_px else []
    down = [f"{abs(y_px)} px {'lower' if y_px > 0 else 'higher'}"] if y_px else []
    return " and ".join(sized + across + down)


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


def _of_one_surface(depths: dict[int, Depth], boxes_of: dict[int, Pixels], calibration: Calibration) -> Share | None:
    """Give the mean share of a box that is as deep as a fruit of its size, and its variance; None of too few boxes."""
    shares = np.concatenate(
        [np.empty(0), *(_shares(depth_m, boxes_of[frame], calibration.fx) for frame, depth_m in depths.items())]
    )
    return (float(shares.mean()), float(shares.var() / len(shares))) if len(shares) >= SOME else None


def _shares(depth_m: Depth, boxes_px: Pixels, focal_px: float) -> NDArray[np.float64]:
    """Give the share of the middle of each box in the picture that lies within its radius of the median."""
    middles, halves = (boxes_px[:, :2] + boxes_px[:, 2:]) / 2, (boxes_px[:, 2:] - boxes_px[:, :2]) / 2
    low, high = np.floor(middles - INNER * halves), np.floor(middles + INNER * halves)
    inside = (low >= 0).all(axis=1) & (high < depth_m.shape[1::-1]).all(axis=1)
    low, high, radii = low[inside], high[inside], halves[inside].max(axis=1) / focal_px
    places = np.round(low[:, None] + (high - low)[:, None] * np.linspace(0, 1, PLACES)[:, None]).astype(int)
    looked_up = depth_m[places[:, :, None, 1], places[:, None, :, 0]].reshape(len(low), PLACES**2)
    known = (looked_up > 0).sum(axis=1)
    told = known >= LEAST_PLACES
    looked_up, known, radii = looked_up[told], known[told], radii[told]
    # Zeros, which are holes, come first.
    in_order, rows = np.sort(looked_up, axis=1), np.arange(len(known))
    holes = PLACES**2 - known
    medians_m = (in_order[rows, holes + (known - 1) // 2] + in_order[rows, holes + known // 2]) / 2
    near = (np.abs(looked_up - medians_m[:, None]) < (radii * medians_m)[:, None]) & (looked_up > 0)
    return np.asarray(near.sum(axis=1) / known, np.float64)
