"""KITTI's layout: `image_l/`, `image_r/` (or image_0 and image_1 ...), `calib.txt`, poses and times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import read_text
from pomona.recording.calibration.rectification import Optics, rectified
from pomona.recording.calibration.rig import Rig, RigCamera
from pomona.recording.formats.frame_times import numbers_in, times_in
from pomona.recording.formats.listed_recording import ListedRecording
from pomona.recording.pictures import numbered_pictures
from pomona.recording.poses import read_kitti
from pomona.recording.rectified_pictures import size_of_first
from pomona.trajectory import Trajectory

__all__ = ["open_kitti", "recognises"]

SIDES = (("image_l", "image_r"), ("image_0", "image_1"), ("image_2", "image_3"), ("image_00", "image_01"))
"""Folders of left and right pictures."""

RATE_HZ = 10.0
"""KITTI's cameras; only for recordings without `times.txt`."""


def recognises(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / "calib.txt").is_file() and any((folder / left).is_dir() for left, _ in SIDES)


def open_kitti(folder: Path, _calibration: Path | None = None, *, own_poses: bool = True) -> ListedRecording:
    """Open a folder; its own calib.txt is its calibration.

    Raises
    ------
    PomonaError
        When pictures, calibration, poses or times do not fit together.
    """
    sides = next(pair for pair in SIDES if (folder / pair[0]).is_dir())
    numbers, left, right = _pairs(folder, sides)
    left_projection, right_projection = _projections(folder / "calib.txt", sides)
    times_s = times_in(folder / "times.txt", len(numbers))
    optics = _optics(folder / "calib.txt", left_projection, right_projection, size_of_first(left))
    poses = _poses(folder / "poses.txt", left_projection, len(numbers)) if own_poses else None
    clock_s = np.arange(len(numbers)) / RATE_HZ if times_s is None else times_s
    listing = (folder / name for name in (*(("poses.txt",) if own_poses else ()), "times.txt"))
    return ListedRecording(
        path=folder,
        kind="KITTI folder",
        optics=optics,
        numbers=numbers,
        recorded_numbers=numbers,
        times_s=times_s,
        pictures={"left": left, "right": right},
        trajectory=None if poses is None else Trajectory(np.array(numbers), clock_s, poses),
        listing=tuple(file for file in listing if file.is_file()),
    )


def _pairs(folder: Path, sides: tuple[str, str]) -> tuple[tuple[int, ...], tuple[Path, ...], tuple[Path, ...]]:
    left, right = (numbered_pictures(folder / side) if (folder / side).is_dir() else {} for side in sides)
    odd = left.keys() ^ right.keys()
    if odd or not left:
        counts = f"{len(left)} pictures in {sides[0]}/ and {len(right)} in {sides[1]}/"
        which = f"; frame {min(odd)} is only in one" if odd else ""
        raise PomonaError(f"{folder}: found {counts}, expected the same frames in both{which}")
    return tuple(left), tuple(left.values()), tuple(right[number] for number in left)


def _projections(path: Path, sides: tuple[str, str]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two lines of 12 numbers, or lines `P0:` to `P3:` of which the folders' numbers choose two."""
    lines = [
        line.partition(":") if ":" in line else ("", "", line) for line in _text(path).splitlines() if line.strip()
    ]
    named = {name.strip(): cells for name, _, cells in lines if name}
    rows = [cells for name, _, cells in lines if not name]
    if named:
        wanted = [f"P{side[-1]}" if side[-1].isdecimal() else f"P{row}" for row, side in enumerate(sides)]
        missing = [name for name in wanted if name not in named]
        if missing:
            raise PomonaError(f"{path}: {missing[0]}: missing, expected a line of 12 numbers")
        rows = [named[name] for name in wanted]
    if len(rows) != 2:
        raise PomonaError(f"{path}: found {len(rows)} projections, expected two lines of 12 numbers: left and right")
    left, right = (numbers_in(path, f"projection {row + 1}", cells, 12).reshape(3, 4) for row, cells in enumerate(rows))
    return left, right


def _optics(path: Path, left: NDArray[np.float64], right: NDArray[np.float64], size_px: tuple[int, int]) -> Optics:
    cameras = [RigCamera(side[:, :3], np.zeros(0), rotation=np.eye(3), projection=side) for side in (left, right)]
    return rectified(Rig((path,), left=cameras[0], right=cameras[1]), size_px, stereo=True)


def _poses(path: Path, left: NDArray[np.float64], n_frames: int) -> NDArray[np.float64] | None:
    """Poses of the left camera; those of the file are of camera 0, beside which the projection says where left is."""
    if not path.is_file():
        return None
    poses = read_kitti(path)
    if len(poses) != n_frames:
        raise PomonaError(f"{path}: found {len(poses)} poses, expected one for each of the {n_frames} frames")
    camera0_from_left = np.eye(4)
    camera0_from_left[:3, 3] = -np.linalg.solve(left[:, :3], left[:, 3])
    return np.asarray(poses @ camera0_from_left)


def _text(path: Path) -> str:
    return read_text(path, "lines of numbers")
