"""The EuRoC (ASL) layout: `mav0/cam0`, `mav0/cam1`, each with `data.csv`, `data/` and `sensor.yaml`."""

from __future__ import annotations

import csv
import io
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.amounts import amount
from pomona.errors import PomonaError, PomonaWarning
from pomona.reading import number_in, read_text, shown, whole_number
from pomona.recording.calibration.rectification import rectified
from pomona.recording.calibration.rig import Rig, RigCamera
from pomona.recording.calibration.rig_files import find_optics
from pomona.recording.calibration.rig_files.fields import array_of
from pomona.recording.calibration.rig_files.kalibr import pinhole
from pomona.recording.calibration.rig_files.yaml_documents import read_documents
from pomona.recording.formats.listed_recording import ListedRecording
from pomona.recording.pictures import picture_inside
from pomona.recording.poses import transforms
from pomona.recording.poses_in_time import posed_rows, poses_at
from pomona.recording.rectified_pictures import size_of_first
from pomona.trajectory import Trajectory

__all__ = ["open_euroc", "recognises"]

TRUTH = "state_groundtruth_estimate0"


def recognises(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return any((place / "cam0" / "data.csv").is_file() for place in (folder / "mav0", folder))


def open_euroc(folder: Path, calibration: Path | None = None, *, own_poses: bool = True) -> ListedRecording:
    """Open the folder above or of `mav0`; a frame's number is its row in the data.csv of cam0, from 0.

    Raises
    ------
    PomonaError
        When lists, calibration or poses are missing or do not fit together.
    """
    root = folder / "mav0" if (folder / "mav0").is_dir() else folder
    left_ns, left = _list(root / "cam0")
    right_ns, right = _list(root / "cam1")
    rows = _simultaneous(root, left_ns, right_ns)
    size_px = size_of_first(left)
    body_from_left, rig = _rig(root)
    optics = rectified(rig, size_px, stereo=True)
    if calibration is not None:
        optics = find_optics(root, size_px, stereo=True, given=calibration)
    listing, poses = [root / "cam0" / "data.csv", root / "cam1" / "data.csv"], None
    truth = root / TRUTH / "data.csv"
    if own_poses and truth.is_file():
        known_ns, session_from_body = _truth(truth)
        # Differences of nanoseconds are exact as integers, and only then.
        start_ns = int(known_ns[0])
        clock_s = (left_ns[rows[:, 0]] - start_ns) / 1e9
        poses, has_pose = poses_at(clock_s, (known_ns - start_ns) / 1e9, session_from_body)
        posed = posed_rows(truth, has_pose)
        left_from_rectified = np.eye(4)
        left_from_rectified[:3, :3] = optics.rectified_from_left.T
        rows, poses = rows[posed], poses[posed] @ body_from_left @ left_from_rectified
        listing.append(truth)
    times_s = left_ns[rows[:, 0]] / 1e9
    return ListedRecording(
        path=folder,
        kind="EuRoC folder",
        optics=optics,
        numbers=tuple(rows[:, 0].tolist()),
        recorded_numbers=tuple(range(len(left))),
        times_s=times_s,
        pictures={"left": tuple(left[row] for row in rows[:, 0]), "right": tuple(right[row] for row in rows[:, 1])},
        trajectory=None if poses is None else Trajectory(rows[:, 0], times_s, poses),
        listing=tuple(listing),
    )


def _list(camera: Path) -> tuple[NDArray[np.int64], tuple[Path, ...]]:
    """Read `timestamp [ns],filename`."""
    path = camera / "data.csv"
    times_ns: list[int] = []
    files: list[Path] = []
    for number, cells in _rows(path):
        where = f"{path}: line {number}"
        time_ns = whole_number(where, cells[0], "nanoseconds,file")
        if len(cells) < 2 or time_ns < 0:
            raise PomonaError(f"{where}: found {shown(','.join(cells))}, expected nanoseconds,file")
        if times_ns and time_ns <= times_ns[-1]:
            raise PomonaError(f"{where}: time {time_ns} ns does not come after {times_ns[-1]} ns")
        times_ns.append(time_ns)
        files.append(picture_inside(where, camera / "data", cells[1]))
    return np.array(times_ns, np.int64), tuple(files)


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    rows = csv.reader(io.StringIO(read_text(path, "lines of nanoseconds,file"), newline=""))
    try:
        for cells in rows:
            if cells and not cells[0].startswith("#"):
                yield rows.line_num, [cell.strip() for cell in cells]
    except csv.Error as error:
        raise PomonaError(f"{path}: line {rows.line_num}: not a CSV text ({error})") from None


def _simultaneous(root: Path, left_ns: NDArray[np.int64], right_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows (left, right) of equal time: the cameras share a trigger; says how many pictures have no partner."""
    _, left, right = np.intersect1d(left_ns, right_ns, return_indices=True)
    alone = len(left_ns) + len(right_ns) - 2 * len(left)
    if len(left) == 0:
        raise PomonaError(f"{root}: found no time that is in both cam0 and cam1, expected pairs of one trigger")
    if alone:
        message = f"{root}: {amount(alone, 'picture')} of cam0 and cam1 without a partner of the same time, left out"
        warnings.warn(message, PomonaWarning, stacklevel=3)
    return np.stack([left, right], axis=1)


def _rig(root: Path) -> tuple[NDArray[np.float64], Rig]:
    (left, body_from_left), (right, body_from_right) = (
        _sensor(root / name / "sensor.yaml") for name in ("cam0", "cam1")
    )
    right_from_left = np.linalg.inv(body_from_right) @ body_from_left
    paths = (root / "cam0" / "sensor.yaml", root / "cam1" / "sensor.yaml")
    return body_from_left, Rig(paths, left, right, right_from_left)


def _sensor(path: Path) -> tuple[RigCamera, NDArray[np.float64]]:
    fields: dict[str, Any] = read_documents(path)[0]
    # T_BS is body_from_sensor.
    return pinhole(str(path), fields, "distortion_coefficients"), array_of(str(path), fields, "T_BS", (4, 4))


def _truth(path: Path) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Read time, position and quaternion (w first) of the body; the columns after those are its speed and biases."""
    times_ns: list[int] = []
    states: list[list[float]] = []
    for number, cells in _rows(path):
        where = f"{path}: line {number}"
        times_ns.append(whole_number(where, cells[0], "nanoseconds"))
        states.append([number_in(where, "state", cell) for cell in cells[1:8]])
        if len(states[-1]) != 7 or not abs(np.linalg.norm(states[-1][3:]) - 1) <= 1e-2:
            raise PomonaError(f"{where}: expected time, position x y z and unit quaternion w x y z")
    if not times_ns or (np.diff(times_ns) <= 0).any():
        raise PomonaError(f"{path}: found no poses or times that go back, expected ascending nanoseconds")
    state = np.array(states)
    return np.array(times_ns, np.int64), transforms(state[:, [4, 5, 6, 3]], state[:, :3])
