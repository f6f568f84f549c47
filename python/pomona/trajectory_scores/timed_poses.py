"""Poses out of files, and which pose of one file is that of the other."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.amounts import amount
from pomona.errors import PomonaError
from pomona.recording.poses import is_kitti, read_kitti, read_tum

__all__ = ["WITHIN_S", "TimedPoses", "paired_rows", "read_poses"]

WITHIN_S = 0.01
"""Between two times that are one: a third of the time from frame to frame of a video."""


@dataclass(frozen=True, eq=False)
class TimedPoses:
    """Poses of a file.

    Attributes
    ----------
    path : Path
        The file.
    poses : (F, 4, 4) float64
        Rigid transforms out of the camera's frame.
    times_s : (F,) float64 or None
        Ascending; None where the file has one pose for each frame and no times.
    """

    path: Path
    poses: NDArray[np.float64]
    times_s: NDArray[np.float64] | None

    def __len__(self) -> int:
        return len(self.poses)


def read_poses(path: Path) -> TimedPoses:
    """Read TUM text, KITTI text or the trajectory of a session (.gpkg); which of them, the file says.

    Raises
    ------
    PomonaError
        The file is none of them, or has no pose.
    """
    if path.suffix.lower() == ".gpkg":
        return _of_session(path)
    times_s, poses = (None, read_kitti(path)) if is_kitti(path) else read_tum(path)
    if not len(poses):
        raise PomonaError(f"{path}: found no pose, expected lines of poses: TUM or KITTI")
    return TimedPoses(path, poses, times_s)


def _of_session(path: Path) -> TimedPoses:
    from pomona.orchard import read_session

    trajectory = read_session(path).trajectory
    if trajectory is None:
        raise PomonaError(f"{path}: found a session without poses, expected a trajectory")
    order = np.argsort(trajectory.times_s, kind="stable")
    return TimedPoses(path, trajectory.session_from_camera[order], trajectory.times_s[order])


def paired_rows(
    estimate: TimedPoses, truth: TimedPoses, within_s: float | None = WITHIN_S
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give the rows (P,) of the estimate and (P,) of the truth that are of one moment, each once, in order of time.

    Where one of the files has no times, or `within_s` is None, they are paired line by line.

    Raises
    ------
    PomonaError
        Fewer than two poses are of one moment, or the lines are not as many.
    """
    if within_s is None or estimate.times_s is None or truth.times_s is None:
        return _by_line(estimate, truth)
    nearest = _nearest(estimate.times_s, truth.times_s)
    apart_s = np.abs(truth.times_s[nearest] - estimate.times_s) if len(truth) else np.empty(0)
    # Of several poses that lie nearest to one true pose, the nearest of them is it.
    order = np.lexsort((np.arange(len(nearest)), apart_s))
    order = order[apart_s[order] <= within_s]
    _, first = np.unique(nearest[order], return_index=True)
    rows = np.sort(order[first])
    if len(rows) < 2:
        n_found = amount(len(rows), "pose")
        found = f"found {n_found} within {within_s:g} s of one of {truth.path}, expected 2 or more"
        raise PomonaError(f"{estimate.path}: {found}: {_why_apart(estimate.times_s, truth.times_s, apart_s)}")
    return rows, nearest[rows]


def _why_apart(times_s: NDArray[np.float64], true_s: NDArray[np.float64], apart_s: NDArray[np.float64]) -> str:
    """Say of times that are not those of the truth whether they lie elsewhere or beside them."""
    if not (len(times_s) and len(true_s)):
        return "there is none"
    if times_s[0] > true_s[-1] or true_s[0] > times_s[-1]:
        return f"its times, {_range(times_s)}, lie beside those there, {_range(true_s)}"
    return f"in the median the nearest there is {np.median(apart_s):.3g} s off, see --within"


def _range(times_s: NDArray[np.float64]) -> str:
    return f"{times_s[0]:.10g} to {times_s[-1]:.10g} s"


def _by_line(estimate: TimedPoses, truth: TimedPoses) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    if len(truth) < 2:
        raise PomonaError(f"{truth.path}: found {amount(len(truth), 'pose')}, expected 2 or more")
    if len(estimate) != len(truth):
        expected = f"expected as many as the {len(truth)} of {truth.path}, line by line"
        raise PomonaError(f"{estimate.path}: found {amount(len(estimate), 'pose')}, {expected}")
    rows = np.arange(len(truth))
    return rows, rows


def _nearest(times_s: NDArray[np.float64], known_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """Row of the known time that is nearest to each; of two as near the earlier."""
    if len(known_s) < 2:
        return np.zeros(len(times_s) if len(known_s) else 0, np.int64)
    after = np.clip(np.searchsorted(known_s, times_s), 1, len(known_s) - 1)
    return np.where(times_s - known_s[after - 1] <= known_s[after] - times_s, after - 1, after)
