"""Whether boxes are of their pictures, or of those of the frames before or after."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.errors import PomonaWarning
from pomona.recording import Recording
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey.part import Boxes

__all__ = ["check_box_times"]

LOOKED_AT = 5
"""Frames, evenly over those with boxes."""

FRAMES_AWAY = (-2, -1, 1, 2)

SURE = 0.3
"""By which colours in boxes and elsewhere differ in pictures that are theirs, at least on the rendered row."""

LEAST, TIMES = 0.1, 2.0
"""By which they differ in other pictures that are to be told, and how many times as much as in their own."""

Box = NDArray[np.float64]


def check_box_times(recording: Recording, parts: Sequence[Boxes]) -> None:
    """Warn where boxes go with the pictures of other frames than theirs; without colour, nothing is said.

    Boxes that are around fruits tell two kinds of colours apart, whatever the fruits; boxes beside them do not.
    """
    if "left" not in recording.description()["pictures"]:
        return
    shown = _evenly([frame for boxes in parts for frame in dict.fromkeys(boxes.frames.tolist())])
    boxes_of = {
        frame: boxes.boxes_px[boxes.frames == frame] for boxes in parts for frame in shown if frame in boxes.frames
    }
    own = _told_apart(recording, boxes_of, 0)
    if not len(own) or own.mean() >= SURE:
        return
    others = {away: _told_apart(recording, boxes_of, away) for away in FRAMES_AWAY}
    means = {away: float(told.mean()) for away, told in others.items() if len(told)}
    best = max(means, key=means.__getitem__, default=0)
    if best and means[best] > max(LEAST, TIMES * float(own.mean())):
        frames = "a frame" if abs(best) == 1 else f"{abs(best)} frames"
        when = "before" if best < 0 else "after"
        found = f"the boxes fit the pictures {frames} {when} theirs, and not their own"
        advice = "check how the program that wrote them counts frames"
        warnings.warn(f"{recording.path}: {found}: {advice}", PomonaWarning, stacklevel=3)


def _evenly(frames: Sequence[int]) -> list[int]:
    rows = (2 * np.arange(LOOKED_AT) + 1) * len(frames) // (2 * LOOKED_AT)
    return [frames[row] for row in dict.fromkeys(rows.tolist())] if frames else []


def _told_apart(recording: Recording, boxes_of: dict[int, Box], away: int) -> NDArray[np.float64]:
    """By how much colours in boxes and elsewhere differ, of 1, in pictures so many frames away; one a frame."""
    numbers = recording.numbers
    number_at = dict(zip(numbers[max(-away, 0) :], numbers[max(away, 0) :], strict=False))
    boxes_at = {number_at[frame]: boxes for frame, boxes in boxes_of.items() if frame in number_at}
    found = []
    for frame in recording.frames(set(boxes_at)):
        try:
            left = None if frame.read_left is None else frame.read_left()
        except UnreadablePictureError:
            continue
        if left is not None:
            _, inside, _, elsewhere = _core.look_of(np.ascontiguousarray(left), boxes_at[frame.number])
            if len(elsewhere):
                found.append(float(inside.mean() - elsewhere.mean()))
    return np.array(found)
