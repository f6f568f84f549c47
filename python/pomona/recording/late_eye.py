"""Whether right pictures were taken with their left ones, or with those of the frame before or after."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pomona.recording.frame import Recording
from pomona.recording.pictures import UnreadablePictureError
from pomona.recording.row_corners import row_errors

__all__ = ["frames_late"]

Array = NDArray[np.float64]

FRAMES_AWAY = (-1, 1)

ENOUGH = 50
"""Corners that agree in other frames before those say anything."""

TIMES = 1.5
"""As many as in their own frames; a camera at rest has as many in all."""

SURE_SHARE = 0.6
"""Of the corners of pictures between which the camera kept its height, those that agree at least."""

FEWEST = 20
"""Corners of which a share says something."""


def frames_late(recording: Recording, rows: list[int], n_own: int, agreeing: Callable[[Array], int]) -> int:
    """Tell by how many frames right pictures are late: 1, -1, or 0 where they are not or nothing says.

    The right picture of a rigid pair lies as high in every frame. That of another frame lies higher or lower as the
    camera went up and down between them. Where it went along its rows that says nothing: a step as long as the baseline
    shows the right picture what the left one saw, and every corner agrees.

    Parameters
    ----------
    recording : Recording
        With left and right pictures.
    rows : list of int
        Of the frames that are looked at.
    n_own : int
        Corners in their own pairs that agree on how both cameras lie.
    agreeing : callable
        Counts those among corners as `row_errors` gives them.
    """
    counts = {away: agreeing(_corners(recording, rows, away)) for away in FRAMES_AWAY}
    best = max(counts, key=counts.__getitem__)
    is_told = counts[best] >= max(ENOUGH, TIMES * n_own) and not _keeps_its_height(recording, rows, agreeing)
    return best if is_told else 0


def _keeps_its_height(recording: Recording, rows: list[int], agreeing: Callable[[Array], int]) -> bool:
    """Tell whether left pictures show the same in the same rows as those beside them."""
    found = [_corners(recording, rows, away, "read_left") for away in FRAMES_AWAY]
    return any(len(corners) >= FEWEST and agreeing(corners) >= SURE_SHARE * len(corners) for corners in found)


def _corners(recording: Recording, rows: list[int], away: int, eye: str = "read_right") -> Array:
    """Find the corners of left pictures in the pictures of an eye so many frames away."""
    found = [np.zeros((0, 4))]
    for row in rows:
        if 0 <= row + away < len(recording):
            here, there = recording.numbers[row], recording.numbers[row + away]
            frames = {frame.number: frame for frame in recording.frames({here, there})}
            read_left, read_there = frames[here].read_left, getattr(frames[there], eye)
            try:
                if read_left is not None and read_there is not None:
                    found.append(row_errors(read_left(), read_there()))
            except UnreadablePictureError:
                continue
    return np.concatenate(found)
