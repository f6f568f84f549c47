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


def frames_late(recording: Recording, rows: list[int], n_own: int, agreeing: Callable[[Array], int]) -> int:
    """Tell by how many frames right pictures are late: 1, -1, or 0 where they are not or nothing says.

    The right picture of a rigid pair lies as high in every frame. That of another frame lies higher or lower as the
    camera went up and down between them.

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
    return best if counts[best] >= max(ENOUGH, TIMES * n_own) else 0


def _corners(recording: Recording, rows: list[int], away: int) -> Array:
    """Find the corners of left pictures in the right pictures so many frames away."""
    found = [np.zeros((0, 3))]
    for row in rows:
        if 0 <= row + away < len(recording):
            here, there = recording.numbers[row], recording.numbers[row + away]
            frames = {frame.number: frame for frame in recording.frames({here, there})}
            read_left, read_right = frames[here].read_left, frames[there].read_right
            try:
                if read_left is not None and read_right is not None:
                    found.append(row_errors(read_left(), read_right()))
            except UnreadablePictureError:
                continue
    return np.concatenate(found)
