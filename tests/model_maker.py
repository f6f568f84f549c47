"""COLMAP models written by struct and by hand, so that nothing of the reader under test is in them."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

NUMBERS = {"SIMPLE_PINHOLE": 0, "PINHOLE": 1, "SIMPLE_RADIAL": 2, "RADIAL": 3, "OPENCV": 4, "FULL_OPENCV": 6}


@dataclass
class Model:
    """A model as its files say it: one camera, images with poses, points with tracks."""

    names: Sequence[str]
    camera_from_model: Array
    camera: str = "PINHOLE"
    size_px: tuple[int, int] = (640, 360)
    parameters: tuple[float, ...] = (500.0, 500.0, 320.0, 180.0)
    points: Array = field(default_factory=lambda: np.array([[0.1, 0.2, 3.0], [1.0, -0.5, 4.0]]))
    rigs: bool = False

    @property
    def poses(self) -> list[list[float]]:
        """qw qx qy qz tx ty tz of each image."""
        turns = Rotation.from_matrix(self.camera_from_model[:, :3, :3]).as_quat()
        return [[*turn[[3, 0, 1, 2]], *pose[:3, 3]] for turn, pose in zip(turns, self.camera_from_model, strict=True)]

    def key_points(self, image: int) -> list[tuple[float, float, int]]:
        """Every image sees every point, at pixels of no meaning, and one thing more that is no point."""
        return [(10.5 + point, 20.25 + image, point + 1) for point in range(len(self.points))] + [(1.0, 2.0, -1)]

    def track(self, point: int) -> list[tuple[int, int]]:
        return [(image + 1, point) for image in range(len(self.names))]

    def write(self, folder: Path, form: str) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        (self._write_text if form == "text" else self._write_binary)(folder)
        return folder

    def _write_text(self, folder: Path) -> None:
        width, height = self.size_px
        numbers = " ".join(map(repr, self.parameters))
        (folder / "cameras.txt").write_text(f"# Camera list\n7 {self.camera} {width} {height} {numbers}\n")
        lines = ["# Image list with two lines of data per image:"]
        for row, (name, pose) in enumerate(zip(self.names, self.poses, strict=True)):
            lines.append(f"{row + 1} {' '.join(map(repr, map(float, pose)))} 7 {name}")
            lines.append(" ".join(f"{x!r} {y!r} {point}" for x, y, point in self.key_points(row)))
        (folder / "images.txt").write_text("\n".join(lines) + "\n")
        points = [
            f"{row + 1} {' '.join(map(repr, place.tolist()))} 10 20 30 0.5 "
            + " ".join(f"{image} {key_point}" for image, key_point in self.track(row))
            for row, place in enumerate(self.points)
        ]
        (folder / "points3D.txt").write_text("# 3D point list\n" + "\n".join(points) + "\n")
        if self.rigs:
            (folder / "rigs.txt").write_text("# Rigs\n3 2 CAMERA 7 CAMERA 8 1 1.0 0.0 0.0 0.0 -0.25 0.0 0.0\n")
            frames = [
                f"{row + 1} 3 {' '.join(map(repr, map(float, pose)))} 1 CAMERA 7 {row + 1}"
                for row, pose in enumerate(self.poses)
            ]
            (folder / "frames.txt").write_text("# Frames\n" + "\n".join(frames) + "\n")

    def _write_binary(self, folder: Path) -> None:
        content = struct.pack("<QIiQQ", 1, 7, NUMBERS[self.camera], *self.size_px)
        (folder / "cameras.bin").write_bytes(content + struct.pack(f"<{len(self.parameters)}d", *self.parameters))
        content = struct.pack("<Q", len(self.names))
        for row, (name, pose) in enumerate(zip(self.names, self.poses, strict=True)):
            key_points = self.key_points(row)
            content += struct.pack("<I7dI", row + 1, *pose, 7) + name.encode() + b"\0"
            content += struct.pack("<Q", len(key_points)) + b"".join(struct.pack("<ddq", *seen) for seen in key_points)
        (folder / "images.bin").write_bytes(content)
        content = struct.pack("<Q", len(self.points))
        for row, place in enumerate(self.points):
            track = self.track(row)
            content += struct.pack("<Q3d3BdQ", row + 1, *place, 10, 20, 30, 0.5, len(track))
            content += b"".join(struct.pack("<II", *seen) for seen in track)
        (folder / "points3D.bin").write_bytes(content)
        if self.rigs:
            rig = struct.pack("<QIIiIiIB7d", 1, 3, 2, 0, 7, 0, 8, 1, 1, 0, 0, 0, -0.25, 0, 0)
            (folder / "rigs.bin").write_bytes(rig)
            content = struct.pack("<Q", len(self.names))
            for row, pose in enumerate(self.poses):
                content += struct.pack("<II7dIiIQ", row + 1, 3, *pose, 1, 0, 7, row + 1)
            (folder / "frames.bin").write_bytes(content)
