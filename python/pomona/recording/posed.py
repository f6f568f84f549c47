"""A recording with the poses of a file of their own, from another program or an earlier scan."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.calibration.rectification import Optics
from pomona.recording.frame import Frame, Recording
from pomona.recording.part_of_recording import PartOfRecording
from pomona.recording.poses import is_kitti, read_kitti, read_tum
from pomona.recording.poses_in_time import posed_rows, poses_at
from pomona.trajectory import Trajectory

__all__ = ["PosedRecording", "RectifiedRecording", "with_poses"]


class RectifiedRecording(Recording, Protocol):
    """A recording that knows how it is rectified."""

    @property
    def optics(self) -> Optics:
        """Camera and rectification."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class PosedRecording(PartOfRecording):
    """The frames of a recording that have a pose; see `Recording` for what it gives.

    Attributes
    ----------
    trajectory : Trajectory
        Of the frames that are left.
    source : Path
        The file of the poses.
    """

    trajectory: Trajectory
    source: Path

    @property
    def numbers(self) -> tuple[int, ...]:
        """Frame numbers that have a pose."""
        return tuple(self.trajectory.frames.tolist())

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Time of each frame."""
        return self.trajectory.times_s

    def __len__(self) -> int:
        return len(self.trajectory)

    def frames(self, numbers: Collection[int] | None = None) -> Iterator[Frame]:
        """Give the frames with their poses, or of them those of some numbers."""
        row_of = {number: row for row, number in enumerate(self.numbers)}
        for frame in self.whole.frames(row_of.keys() if numbers is None else row_of.keys() & set(numbers)):
            row = row_of[frame.number]
            pose = self.trajectory.session_from_camera[row]
            yield dataclasses.replace(frame, time_s=float(self.times_s[row]), session_from_camera=pose)

    def inputs(self) -> Iterator[Path]:
        """Give the files of the recording and that of the poses."""
        yield from self.whole.inputs()
        yield self.source

    def description(self) -> dict[str, Any]:
        """Say what was found."""
        found = self.whole.description()
        return {
            **found,
            "frames": len(self),
            "pictures": dict.fromkeys(found["pictures"], len(self)),
            "poses": True,
        }


def with_poses(recording: RectifiedRecording, path: Path) -> Recording:
    """Give a recording the poses of a file: TUM by time, KITTI one line a frame.

    Poses are those of the left camera as it was recorded, x right, y down, z forward. TUM's are interpolated at the
    times of the pictures; where no time fits but there is one pose for each frame, they are taken in order, and a
    warning says so.

    Raises
    ------
    PomonaError
        When there is no pose for any frame, or not one a line for each.
    """
    if is_kitti(path):
        poses = read_kitti(path)
        _require_one_each(path, len(poses), len(recording))
        times_s = recording.times_s
        known_s = np.arange(len(poses), dtype=np.float64) if times_s is None else times_s
        return _posed(recording, path, np.arange(len(poses)), known_s, poses)
    known_s, known = read_tum(path)
    times_s = recording.times_s
    if times_s is not None:
        poses, has_pose = poses_at(times_s, known_s, known)
        if has_pose.any() or len(known) != len(recording):
            rows = posed_rows(path, has_pose, clocks=(times_s, known_s))
            return _posed(recording, path, rows, times_s[rows], poses[rows])
        message = f"{path}: no pose at the time of any picture: taken one for each frame, in order"
        warnings.warn(message, PomonaWarning, stacklevel=3)
    _require_one_each(path, len(known), len(recording))
    return _posed(recording, path, np.arange(len(known)), known_s if times_s is None else times_s, known)


def _require_one_each(path: Path, n_poses: int, n_frames: int) -> None:
    if n_poses != n_frames:
        raise PomonaError(f"{path}: found {n_poses} poses, expected one for each of the {n_frames} frames")


def _posed(
    recording: RectifiedRecording,
    path: Path,
    rows: NDArray[np.int64],
    times_s: NDArray[np.float64],
    session_from_left: NDArray[np.float64],
) -> PosedRecording:
    left_from_rectified = np.eye(4)
    left_from_rectified[:3, :3] = recording.optics.rectified_from_left.T
    numbers = np.array(recording.numbers, np.int64)[rows]
    return PosedRecording(recording, Trajectory(numbers, times_s, session_from_left @ left_from_rectified), path)
