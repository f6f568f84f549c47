"""Boxes of a few frames, evenly over those that have some, for checks that look at pictures again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.recording import Recording
from pomona.recording.evenly import evenly
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey.part import Boxes

__all__ = ["LOOKED_AT", "Pixels", "frames_in_words", "pictures_of", "sampled_boxes"]

Pixels = NDArray[np.float64]

LOOKED_AT = 5
"""Frames."""


def sampled_boxes(parts: Sequence[Boxes], n_frames: int = LOOKED_AT) -> dict[int, Pixels]:
    """Give the boxes, (D, 4) pixels, of so many frames at the most by their numbers."""
    frames = [frame for boxes in parts for frame in dict.fromkeys(boxes.frames.tolist())]
    shown = [frames[row] for row in evenly(len(frames), n_frames)]
    return {frame: boxes.boxes_px[boxes.frames == frame] for boxes in parts for frame in shown if frame in boxes.frames}


def pictures_of(recording: Recording, boxes_of: Mapping[int, Pixels]) -> Iterator[tuple[NDArray[np.uint8], Pixels]]:
    """Give the left picture of each of these frames that has one which can be read, with its boxes."""
    for frame in recording.frames(set(boxes_of)):
        try:
            left = None if frame.read_left is None else frame.read_left()
        except UnreadablePictureError:
            continue
        if left is not None:
            yield np.ascontiguousarray(left), boxes_of[frame.number]


def frames_in_words(away: int) -> str:
    """Say how many frames lie between two."""
    return "a frame" if abs(away) == 1 else f"{abs(away)} frames"
