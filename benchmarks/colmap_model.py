"""The poses of a recording as a COLMAP model with a frame and a scale of its own, written without the reader's code."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pomona.recording import Recording

__all__ = ["write_model"]

Array = NDArray[np.float64]

PINHOLE = 1
CAMERA = 1


def write_model(folder: Path, recording: Recording, rng: np.random.Generator, *, form: str) -> float:
    """Write the poses, turned, moved and scaled at random, as text or with rigs as binary; return metres a unit."""
    assert recording.trajectory is not None
    units_per_m = float(np.exp(rng.uniform(np.log(0.1), np.log(10))))
    turn, shift = Rotation.random(random_state=rng).as_matrix(), units_per_m * rng.uniform(-20, 20, 3)
    poses = [_words(pose, turn, units_per_m, shift) for pose in recording.trajectory.session_from_camera]
    names = [f"left/{name}" for name in sorted(file.name for file in (recording.path / "left").iterdir())]
    calibration = recording.calibration
    numbers = (calibration.fx, calibration.fy, calibration.cx, calibration.cy)
    (_write_text if form == "text" else _write_binary)(folder, names, poses, calibration.size_px, numbers)
    return 1 / units_per_m


def _words(
    pose: NDArray[np.float64], turn: NDArray[np.float64], units_per_m: float, shift: NDArray[np.float64]
) -> list[float]:
    """Give qw qx qy qz tx ty tz of camera_from_model, where x_model = s R x + t."""
    rotation = pose[:3, :3].T @ turn.T
    place = -rotation @ (units_per_m * turn @ pose[:3, 3] + shift)
    x, y, z, w = Rotation.from_matrix(rotation).as_quat().tolist()
    return [w, x, y, z, *place.tolist()]


def _write_text(
    folder: Path, names: list[str], poses: list[list[float]], size_px: tuple[int, int], numbers: tuple[float, ...]
) -> None:
    camera = " ".join(map(str, (CAMERA, "PINHOLE", *size_px, *numbers)))
    lines = [
        f"{row + 1} {' '.join(map(repr, pose))} {CAMERA} {name}\n\n"
        for row, (name, pose) in enumerate(zip(names, poses, strict=True))
    ]
    (folder / "cameras.txt").write_text(f"{camera}\n")
    (folder / "images.txt").write_text("".join(lines))
    (folder / "points3D.txt").write_text("# none\n")


def _write_binary(
    folder: Path, names: list[str], poses: list[list[float]], size_px: tuple[int, int], numbers: tuple[float, ...]
) -> None:
    n = struct.pack("<Q", len(names))
    images = [
        struct.pack("<I7dI", row + 1, *pose, CAMERA) + name.encode() + struct.pack("<BQ", 0, 0)
        for row, (name, pose) in enumerate(zip(names, poses, strict=True))
    ]
    frames = [struct.pack("<II7dIiIQ", row + 1, 1, *pose, 1, 0, CAMERA, row + 1) for row, pose in enumerate(poses)]
    (folder / "cameras.bin").write_bytes(struct.pack("<QIiQQ4d", 1, CAMERA, PINHOLE, *size_px, *numbers))
    (folder / "images.bin").write_bytes(n + b"".join(images))
    (folder / "points3D.bin").write_bytes(struct.pack("<Q", 0))
    (folder / "rigs.bin").write_bytes(struct.pack("<QIIiI", 1, 1, 1, 0, CAMERA))
    (folder / "frames.bin").write_bytes(n + b"".join(frames))
