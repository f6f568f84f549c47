"""One frame of a recording, and what every kind of recording gives."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pomona.recording.calibration import Calibration
from pomona.trajectory import Trajectory

__all__ = ["Frame", "Recording", "chosen_rows"]

Picture = NDArray[np.uint8]
Depth = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Frame:
    """One instant of a recording. Pictures are decoded when asked for and not kept, so memory does not grow.

    They may be asked for in any order and from any thread.

    Attributes
    ----------
    number : int
        Frame number, unique in the recording.
    time_s : float or None
        Seconds, on the recording's own clock, None where nobody noted it.
    session_from_camera : (4, 4) float64 or None
        Pose of the left camera, None where the recording has no poses.
    read_left, read_right : callable or None
        Give (H, W, 3) uint8, BGR; None where there is no such picture.
    read_depth : callable or None
        Gives (H, W) float32, metres along the optical axis of the left camera, 0 where nothing was measured.
    """

    number: int
    time_s: float | None = None
    session_from_camera: NDArray[np.float64] | None = None
    read_left: Callable[[], Picture] | None = None
    read_right: Callable[[], Picture] | None = None
    read_depth: Callable[[], Depth] | None = None


class Recording(Protocol):
    """A recording of any kind, as the survey sees it."""

    @property
    def path(self) -> Path:
        """Where it came from."""

    @property
    def name(self) -> str:
        """Name of the session that is made of it."""

    @property
    def date(self) -> str | None:
        """When it was made, ISO 8601, None where nobody noted it."""

    @property
    def calibration(self) -> Calibration:
        """The rectified left camera, and the baseline."""

    @property
    def trajectory(self) -> Trajectory | None:
        """Poses that came with it."""

    @property
    def numbers(self) -> tuple[int, ...]:
        """Frame numbers in order of time."""

    @property
    def recorded_numbers(self) -> tuple[int, ...]:
        """Numbers of all frames that were recorded, in order of time: also of those left out of `numbers`.

        Frames are left out that have no pose or no partner, or that were not chosen. Files of boxes count these ones.
        """

    @property
    def times_s(self) -> NDArray[np.float64] | None:
        """Time of each frame, ascending, None where nobody noted it."""

    def __len__(self) -> int:
        """Count the frames."""

    def frames(self, numbers: Collection[int] | None = None) -> Iterator[Frame]:
        """Give the frames in order of time, or of them only those with these numbers.

        What lies between them is not decoded where the format allows.
        """

    def inputs(self) -> Iterator[Path]:
        """Give the files that a session made of it depends on, for their hashes."""

    def description(self) -> dict[str, Any]:
        """Say in short what was found: `pomona info`."""


def chosen_rows(all_numbers: tuple[int, ...], chosen: Collection[int] | None) -> Iterator[tuple[int, int]]:
    """Give (row, number) of each frame, or of those that were chosen."""
    wanted = None if chosen is None else frozenset(chosen)
    return ((row, number) for row, number in enumerate(all_numbers) if wanted is None or number in wanted)
