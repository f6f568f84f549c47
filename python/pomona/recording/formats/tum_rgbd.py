"""TUM's RGB-D layout: `rgb.txt` and `depth.txt` list pictures by time, `groundtruth.txt` the poses."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError, PomonaWarning
from pomona.reading import number_in, read_text, shown
from pomona.recording.calibration.rig_files import find_optics
from pomona.recording.formats.listed_recording import ListedRecording
from pomona.recording.pairing import mutually_nearest
from pomona.recording.pictures import picture_inside
from pomona.recording.poses import read_tum
from pomona.recording.poses_in_time import posed_rows, poses_at
from pomona.recording.rectified_pictures import size_of_first
from pomona.trajectory import Trajectory

__all__ = ["open_tum_rgbd", "recognises"]

FARTHEST_S = 0.02
"""Colour and depth that are farther apart in time are not of one instant: TUM's own tools take 20 ms too."""

DEPTH_UNIT_M = 1 / 5000
"""Of the layout's depth pictures, where the calibration does not say another."""


def recognises(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / "depth.txt").is_file() and (folder / "rgb.txt").is_file()


def open_tum_rgbd(folder: Path, calibration: Path | None = None, *, own_poses: bool = True) -> ListedRecording:
    """Open a folder; a frame's number is its row in `rgb.txt`, from 0.

    Raises
    ------
    PomonaError
        When lists, calibration or poses are missing or do not fit together.
    """
    colour_s, colour = _list(folder / "rgb.txt")
    depth_s, depth = _list(folder / "depth.txt")
    rows = _associated(folder, colour_s, depth_s)
    optics = find_optics(folder, size_of_first(colour), stereo=False, given=calibration, depth_unit_m=DEPTH_UNIT_M)
    listing, poses = [folder / "rgb.txt", folder / "depth.txt"], None
    truth = folder / "groundtruth.txt"
    if own_poses and truth.is_file():
        poses, has_pose = poses_at(colour_s[rows[:, 0]], *read_tum(truth))
        posed = posed_rows(truth, has_pose)
        rows, poses = rows[posed], poses[posed]
        listing.append(truth)
    times_s = colour_s[rows[:, 0]]
    return ListedRecording(
        path=folder,
        kind="TUM RGB-D folder",
        optics=optics,
        numbers=tuple(rows[:, 0].tolist()),
        recorded_numbers=tuple(range(len(colour))),
        times_s=times_s,
        pictures={"left": tuple(colour[row] for row in rows[:, 0]), "depth": tuple(depth[row] for row in rows[:, 1])},
        trajectory=None if poses is None else Trajectory(rows[:, 0], times_s, poses),
        listing=tuple(listing),
    )


def _list(path: Path) -> tuple[NDArray[np.float64], tuple[Path, ...]]:
    """Read lines of `time file`; `#` starts a comment."""
    times_s: list[float] = []
    files: list[Path] = []
    for number, line in enumerate(read_text(path, "lines of time and file").splitlines(), start=1):
        words = line.partition("#")[0].split(maxsplit=1)
        if not words:
            continue
        try:
            time_s, file = number_in(f"{path}: line {number}", "time", words[0]), words[1].strip()
        except IndexError:
            raise PomonaError(f"{path}: line {number}: found {shown(line)}, expected a time and a file") from None
        if times_s and time_s <= times_s[-1]:
            raise PomonaError(f"{path}: line {number}: time {time_s:.6f} s does not come after {times_s[-1]:.6f} s")
        times_s.append(time_s)
        files.append(picture_inside(f"{path}: line {number}", path.parent, file))
    return np.array(times_s), tuple(files)


def _associated(folder: Path, colour_s: NDArray[np.float64], depth_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """Rows (colour, depth) of pictures that are each other's nearest in time; says how many colour ones are left."""
    if not (len(colour_s) and len(depth_s)):
        raise PomonaError(f"{folder}: found {len(colour_s)} pictures in rgb.txt and {len(depth_s)} in depth.txt")
    kept = mutually_nearest(colour_s, depth_s, FARTHEST_S)
    if len(kept) == 0:
        raise PomonaError(f"{folder}: found no colour and depth within {FARTHEST_S:g} s, expected one clock")
    if len(kept) < len(colour_s):
        left_out = f"{len(colour_s) - len(kept)} of {len(colour_s)} colour pictures"
        message = f"{folder}: {left_out} have no depth within {FARTHEST_S:g} s and are left out"
        warnings.warn(message, PomonaWarning, stacklevel=3)
    return kept
