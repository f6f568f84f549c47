"""Camera poses as text: TUM's `time tx ty tz qx qy qz qw`, or KITTI's 3x4 matrices; one line a pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.errors import PomonaError
from pomona.reading import number_in, read_text
from pomona.trajectory import Trajectory

__all__ = [
    "KITTI_SUFFIX",
    "is_kitti",
    "read_kitti",
    "read_tum",
    "transforms",
    "write_kitti",
    "write_poses",
    "write_tum",
]

KITTI_SUFFIX = ".kitti"
"""Of names under which poses are written as KITTI's; under all others as TUM's."""

TUM_COLUMNS = "# time tx ty tz qx qy qz qw"
"""First line of the TUM files that are written here, before what their poses are."""

UNIT_TOLERANCE = 1e-2
"""Quaternions are written with few digits; one that is 1 % off unit length is something else."""


def read_tum(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Read poses; `#` starts a comment.

    Returns
    -------
    times_s : (F,) float64
        Ascending.
    session_from_camera : (F, 4, 4) float64
        OpenCV axes: x right, y down, z forward.
    """
    rows = [_row(path, number, line) for number, line in _lines(path)]
    table = np.array(rows, np.float64).reshape(-1, 8)
    if (np.diff(table[:, 0]) <= 0).any():
        late = int(np.argmax(np.diff(table[:, 0]) <= 0)) + 1
        raise PomonaError(f"{path}: pose {late + 1}: time {table[late, 0]:g} s does not come after the one before")
    return table[:, 0], transforms(table[:, 4:], table[:, 1:4])


def read_kitti(path: Path) -> NDArray[np.float64]:
    """Read (F, 4, 4) poses of 12 numbers a line, row by row.

    Raises
    ------
    PomonaError
        When a line has other numbers, or a pose stretches.
    """
    poses = [np.eye(4)[:0]]
    for number, line in _lines(path):
        cells = _cells(path, number, line)
        if len(cells) != 12:
            raise PomonaError(f"{path}: line {number}: found {len(cells)} numbers, expected 12 finite ones")
        poses.append(np.vstack([np.reshape(cells, (3, 4)), [0.0, 0.0, 0.0, 1.0]]))
    matrices = np.concatenate(poses).reshape(-1, 4, 4)
    rotations = matrices[:, :3, :3]
    if len(matrices) and np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max() > UNIT_TOLERANCE:
        raise PomonaError(f"{path}: found a pose that does not turn but stretch, expected 3x4 rotation and position")
    if (np.linalg.det(rotations) < 0).any():
        raise PomonaError(f"{path}: found a pose that mirrors, expected 3x4 rotation and position")
    return matrices


def write_tum(path: Path, trajectory: Trajectory, transform: str = "session_from_camera") -> None:
    """Write poses as `read_tum` reads them; `transform` is what the first line calls them."""
    from scipy.spatial.transform import Rotation

    poses = trajectory.session_from_camera
    # Of no rotations SciPy makes no quaternions.
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat(canonical=True) if len(poses) else np.empty((0, 4))
    lines = [f"{TUM_COLUMNS}: {transform}"]
    for time_s, pose, quaternion in zip(trajectory.times_s, poses, turns, strict=True):
        lines.append(f"{time_s:.6f} " + " ".join(f"{number:.9f}" for number in (*pose[:3, 3], *quaternion)))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_kitti(path: Path, trajectory: Trajectory) -> None:
    """Write poses as `read_kitti` reads them: 12 numbers a line, and neither times nor a heading."""
    rows = trajectory.session_from_camera[:, :3].reshape(-1, 12)
    lines = [" ".join(f"{number:.9f}" for number in row) for row in rows]
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def write_poses(path: Path, trajectory: Trajectory, transform: str = "session_from_camera") -> None:
    """Write poses as the name says, `KITTI_SUFFIX` or TUM; the file appears whole or not at all."""
    with whole_file(path) as partial:
        if path.suffix.lower() == KITTI_SUFFIX:
            write_kitti(partial, trajectory)
        else:
            write_tum(partial, trajectory, transform)


def is_kitti(path: Path) -> bool:
    """Whether the first line has the 12 numbers of a matrix."""
    first = next((line for _, line in _lines(path)), "")
    return len(first.split()) == 12


def transforms(quaternions: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rigid transforms (F, 4, 4) of (F, 4) quaternions x, y, z, w and (F, 3) positions."""
    poses = np.tile(np.eye(4), (len(positions), 1, 1))
    poses[:, :3, :3] = _rotations(quaternions)
    poses[:, :3, 3] = positions
    return poses


def _lines(path: Path) -> list[tuple[int, str]]:
    text = read_text(path, "lines of poses: TUM or KITTI")
    numbered = ((number, line.partition("#")[0].strip()) for number, line in enumerate(text.splitlines(), start=1))
    return [(number, line) for number, line in numbered if line]


def _row(path: Path, number: int, line: str) -> list[float]:
    row = _cells(path, number, line)
    if len(row) != 8:
        raise PomonaError(f"{path}: line {number}: found {len(row)} numbers, expected time tx ty tz qx qy qz qw")
    length = float(np.linalg.norm(row[4:]))
    if abs(length - 1.0) > UNIT_TOLERANCE:
        raise PomonaError(f"{path}: line {number}: found a quaternion of length {length:.3g}, expected 1")
    return row


def _cells(path: Path, number: int, line: str) -> list[float]:
    return [number_in(f"{path}: line {number}", "pose", cell) for cell in line.split()]


def _rotations(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrices of (F, 4) quaternions x, y, z, w."""
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
