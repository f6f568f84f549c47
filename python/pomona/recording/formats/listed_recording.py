"""A recording whose pictures are files in a list: KITTI, TUM RGB-D and EuRoC layouts."""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.recording.calibration import Calibration
from pomona.recording.calibration.rectification import Optics
from pomona.recording.card import RecordingCard
from pomona.recording.dates import date_in_name
from pomona.recording.description import describe
from pomona.recording.frame import Frame, chosen_rows
from pomona.recording.rectified_pictures import read_rectified
from pomona.trajectory import Trajectory

__all__ = ["ListedRecording"]


@dataclass(frozen=True, eq=False, repr=False)
class ListedRecording(RecordingCard):
    """Frames by row; see `Recording` for what it gives.

    Attributes
    ----------
    kind : str
        Name of the layout.
    optics : Optics
        Camera and rectification.
    numbers : tuple of int
        Frame numbers.
    recorded_numbers : tuple of int
        Numbers of all left pictures, also of those that are no frame.
    times_s : (F,) float64 or None
        Time of each frame.
    pictures : mapping
        For `left`, `right`, `depth`, as there are: one file a frame.
    listing : tuple of Path
        Files that say which pictures there are and where the camera was.
    """

    path: Path
    kind: str
    optics: Optics
    numbers: tuple[int, ...]
    recorded_numbers: tuple[int, ...]
    times_s: NDArray[np.float64] | None
    pictures: Mapping[str, tuple[Path, ...]]
    trajectory: Trajectory | None
    listing: tuple[Path, ...]

    @property
    def calibration(self) -> Calibration:
        """The rectified left camera."""
        return self.optics.calibration

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.path.resolve().name

    @property
    def date(self) -> str | None:
        """The date in the folder's name."""
        return date_in_name(self.name)

    def __len__(self) -> int:
        return len(self.numbers)

    def frames(self, numbers: Collection[int] | None = None) -> Iterator[Frame]:
        """Give the frames in order, or those of some numbers; nothing is decoded yet."""
        for row, number in chosen_rows(self.numbers, numbers):
            yield Frame(
                number=number,
                time_s=None if self.times_s is None else float(self.times_s[row]),
                session_from_camera=None if self.trajectory is None else self.trajectory.session_from_camera[row],
                read_left=self._reader("left", row),
                read_right=self._reader("right", row),
                read_depth=self._reader("depth", row),
            )

    def inputs(self) -> Iterator[Path]:
        """Give lists, calibration, detections and depth pictures."""
        yield from self.listing
        yield from self.optics.inputs
        if (self.path / "detections.csv").is_file():
            yield self.path / "detections.csv"
        yield from (file for file in self.pictures.get("depth", ()) if file.is_file())

    def description(self) -> dict[str, Any]:
        """Say what was found."""
        counts = {kind: len(files) for kind, files in self.pictures.items()}
        times_s = None if self.times_s is None else self.times_s.tolist()
        return describe(self, self.kind, times_s, counts)

    def _reader(self, kind: str, row: int) -> Any:
        if kind not in self.pictures:
            return None
        return functools.partial(read_rectified, kind, self.pictures[kind][row], self.optics)
