"""When the frames of a recording were taken, as its files say it."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError, PomonaWarning
from pomona.reading import number_in, read_text

__all__ = ["numbers_in", "times_beside_poses", "times_in"]

Array = NDArray[np.float64]


def times_in(path: Path, n_frames: int) -> Array | None:
    """Read the time of each frame, in seconds, from a text of nothing else; None where it is not there.

    Raises
    ------
    PomonaError
        When they are not one for each frame, or go back.
    """
    if not path.is_file():
        return None
    return _ascending(path, numbers_in(path, "times", read_text(path, "lines of numbers"), n_frames))


def times_beside_poses(path: Path, n_frames: int) -> Array | None:
    """Read the times alone from a file of TUM poses that are not wanted, one for each frame.

    They may be broken, as poses that nobody wants may: then there are none, and a warning says so.
    """
    if not path.is_file():
        return None
    try:
        lines = (line.partition("#")[0].split() for line in read_text(path, "lines of poses").splitlines())
        return _ascending(path, numbers_in(path, "times", " ".join(words[0] for words in lines if words), n_frames))
    except PomonaError as error:
        warnings.warn(f"{error}: no times of frames are taken from there", PomonaWarning, stacklevel=6)
        return None


def numbers_in(path: Path, what: str, text: str, count: int) -> Array:
    """Read so many numbers, finite ones."""
    numbers = [number_in(str(path), what, cell) for cell in text.split()]
    if len(numbers) != count:
        raise PomonaError(f"{path}: {what}: found {len(numbers)} numbers, expected {count} finite ones")
    return np.array(numbers)


def _ascending(path: Path, times_s: Array) -> Array:
    back = np.flatnonzero(np.diff(times_s) <= 0)
    if len(back):
        row = int(back[0]) + 1
        raise PomonaError(f"{path}: line {row + 1}: time {times_s[row]:g} s does not come after {times_s[row - 1]:g} s")
    return times_s
