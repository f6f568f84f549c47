"""Whether boxes are of their pictures, or of those of frames before or after, or of pictures of another size."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.errors import PomonaWarning
from pomona.recording import Recording
from pomona.survey.part import Boxes
from pomona.survey.sampled_boxes import frames_in_words, pictures_of, sampled_boxes

__all__ = ["check_box_times"]

FRAMES_AWAY = (-1, 1, -2, 2, -3, 3, -4, 4, -5, 5, -6, 6, -7, 7, -8, 8)
"""A program that skips what cannot be read, or begins when all is warm, counts some frames less."""

SIZES = (2.0, 0.5, 3.0, 1 / 3, 1.5, 2 / 3)
"""Of the picture, over those of the one that boxes were made in."""

SURE = 0.3
"""By which colours in boxes and elsewhere differ in pictures that are theirs, at least on the rendered row."""

LEAST, TIMES = 0.1, 2.0
"""By which they differ in other pictures that are to be told, and how many times as much as in their own. Farther than
two frames away, and in other sizes, `SURE` is asked for: much is tried."""

NEAR, SOME = 2, 20
"""Frames away that are near, and boxes without which nothing else is tried."""

Box = NDArray[np.float64]


def check_box_times(recording: Recording, parts: Sequence[Boxes]) -> bool:
    """Warn where boxes go with pictures of other frames than theirs, or of another size; without colour, say nothing.

    Boxes that are around fruits tell two kinds of colours apart, whatever the fruits; boxes beside them do not. Returns
    whether something was said.
    """
    if "left" not in recording.description()["pictures"]:
        return False
    boxes_of = sampled_boxes(parts)
    own = _told_apart(recording, boxes_of, 0)
    if not len(own) or own.mean() >= SURE:
        return False
    near = [away for away in FRAMES_AWAY if abs(away) <= NEAR]
    told = _best([(_of_frame(away), _told_apart(recording, boxes_of, away)) for away in near], LEAST, own)
    if not told and sum(map(len, boxes_of.values())) >= SOME:
        tried = [
            *((_of_frame(away), _told_apart(recording, boxes_of, away)) for away in FRAMES_AWAY if away not in near),
            *((_of_size(size), _told_apart(recording, _sized(boxes_of, size), 0)) for size in SIZES),
        ]
        told = _best(tried, SURE, own)
    if told:
        warnings.warn(f"{recording.path}: {told}", PomonaWarning, stacklevel=3)
    return bool(told)


def _best(tried: list[tuple[str, NDArray[np.float64]]], least: float, own: NDArray[np.float64]) -> str | None:
    """Give the words of what tells colours apart best, where that is enough."""
    best, words = max(((float(told.mean()), words) for words, told in tried if len(told)), default=(0.0, ""))
    return words if best > max(least, TIMES * float(own.mean())) else None


def _of_frame(away: int) -> str:
    """Say that boxes are of the pictures so many frames away."""
    when = "before" if away < 0 else "after"
    found = f"the boxes fit the pictures {frames_in_words(away)} {when} theirs, and not their own"
    return f"{found}: check how the program that wrote them counts frames"


def _of_size(size: float) -> str:
    """Say that boxes are of pictures of another size."""
    found = f"the boxes fit the pictures when they are {size:.2g} times as large, and not as they are"
    return f"{found}: give them in pixels of these pictures"


def _sized(boxes_of: dict[int, Box], size: float) -> dict[int, Box]:
    return {frame: size * boxes_px for frame, boxes_px in boxes_of.items()}


def _told_apart(recording: Recording, boxes_of: dict[int, Box], away: int) -> NDArray[np.float64]:
    """By how much colours in boxes and elsewhere differ, of 1, in pictures so many frames away; one a frame."""
    numbers = recording.numbers
    number_at = dict(zip(numbers[max(-away, 0) :], numbers[max(away, 0) :], strict=False))
    boxes_at = {number_at[frame]: boxes for frame, boxes in boxes_of.items() if frame in number_at}
    looks = [_core.look_of(*shown) for shown in pictures_of(recording, boxes_at)]
    return np.array([inside.mean() - elsewhere.mean() for _, inside, _, elsewhere in looks if len(elsewhere)], float)
