"""A part of a recording: from one frame to another, every so many of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording.frame import Frame, Recording
from pomona.recording.part_of_recording import PartOfRecording
from pomona.trajectory import Trajectory

__all__ = ["SelectedRecording", "selected"]


@dataclass(frozen=True, eq=False, repr=False)
class SelectedRecording(PartOfRecording):
    """Some frames of a recording; see `Recording` for what it gives.

    Attributes
    ----------
    numbers : tuple of int
        Frame numbers that are left, those of the whole recording.
    every : int
        One of so many frames was taken.
    """

    numbers: tuple[int, ...]
    every: int

    @property
    def trajectory(self) -> Trajectory | None:
        """Poses of the frames that are left."""
        whole = self.whole.trajectory
        if whole is None:
            return None
        rows = np.isin(whole.frames, self.numbers)
        return Trajectory(whole.frames[rows], whole.times_s[rows], whole.session_from_camera[rows])

    @property
    def times_s(self) -> NDArray[np.float64] | None:
        """Times of the frames that are left."""
        times_s = self.whole.times_s
        return None if times_s is None else times_s[np.isin(self.whole.numbers, self.numbers)]

    def __len__(self) -> int:
        return len(self.numbers)

    def frames(self, numbers: Collection[int] | None = None) -> Iterator[Frame]:
        """Give the frames that are left, or of them those of some numbers."""
        return self.whole.frames(self.numbers if numbers is None else frozenset(self.numbers) & frozenset(numbers))

    def inputs(self) -> Iterator[Path]:
        """Give the files of the whole."""
        return self.whole.inputs()

    def description(self) -> dict[str, Any]:
        """Say what was found, with the frames that are left."""
        found = self.whole.description()
        rate_hz = found.get("rate_hz")
        return {
            **found,
            "frames": len(self),
            "rate_hz": None if rate_hz is None or len(self) < 2 else rate_hz / self.every,
            "pictures": dict.fromkeys(found["pictures"], len(self)),
        }


def selected(recording: Recording, *, every: int = 1, first: int | None = None, last: int | None = None) -> Recording:
    """Take a part of a recording; the others are not decoded where the format allows.

    Parameters
    ----------
    recording : Recording
        Of any kind.
    every : int
        Take the first frame and then one of so many.
    first, last : int, optional
        Frame numbers, both included.

    Raises
    ------
    PomonaError
        When `every` is not positive, or no frame is left.
    """
    if every < 1:
        raise PomonaError(f"every: found {every}, expected 1 or more")
    within = [
        number
        for number in recording.numbers
        if (first is None or number >= first) and (last is None or number <= last)
    ]
    if not within:
        asked = " ".join(f"{word} {number}" for word, number in (("from", first), ("to", last)) if number is not None)
        there = f"{recording.numbers[0]} to {recording.numbers[-1]}" if len(recording) else "none"
        raise PomonaError(f"{recording.path}: found no frame {asked}, expected some of {there}")
    if every == 1 and len(within) == len(recording):
        return recording
    return SelectedRecording(recording, tuple(within[::every]), every)
