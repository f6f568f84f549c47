"""A made-up drive past two textured walls, seen by a stereo camera: exact pictures, depth and poses."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pomona.recording import Calibration

CALIBRATION = Calibration(width=320, height=240, fx=260.0, fy=260.0, cx=160.0, cy=120.0, baseline_m=0.1)

TEXELS_PER_M = 250.0


@dataclass(frozen=True)
class Wall:
    """A wall at a depth, from a row of the session upwards or downwards, its texture 10 m long and 4 m high."""

    depth_m: float
    texture: NDArray[np.uint8]


@dataclass(frozen=True)
class Drive:
    """Walls, far to near; the near one is a strip low in the picture."""

    walls: tuple[Wall, ...]
    poses: NDArray[np.float64]

    def pictures(self, row: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.float32]]:
        """Left, right and depth of a pose."""
        right = self.poses[row] @ _translation((CALIBRATION.baseline_m or 0.0, 0.0, 0.0))
        left, depth_m = self._picture(self.poses[row])
        return left, self._picture(right)[0], depth_m

    def _picture(self, session_from_camera: NDArray[np.float64]) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        size = CALIBRATION.size_px
        picture, depth_m = np.zeros(size[::-1], np.uint8), np.zeros(size[::-1], np.float32)
        camera_from_session = np.linalg.inv(session_from_camera)
        intrinsics = np.array(
            [
                [CALIBRATION.fx, 0.0, CALIBRATION.cx - 0.5],
                [0.0, CALIBRATION.fy, CALIBRATION.cy - 0.5],
                [0.0, 0.0, 1.0],
            ]
        )
        for wall in self.walls:
            # Texel (a, b) is the session's point ((a / k) - 2, (b / k) - top, depth).
            top = 2.0 if wall is self.walls[0] else -0.25
            point = np.array(
                [
                    [1 / TEXELS_PER_M, 0.0, -2.0],
                    [0.0, 1 / TEXELS_PER_M, -top],
                    [0.0, 0.0, wall.depth_m],
                    [0.0, 0.0, 1.0],
                ]
            )
            in_camera = (camera_from_session @ point)[:3]
            seen = cv2.warpPerspective(wall.texture, intrinsics @ in_camera, size, flags=cv2.INTER_LINEAR)
            shown = cv2.warpPerspective(np.full_like(wall.texture, 255), intrinsics @ in_camera, size) > 250
            texel = np.linalg.inv(intrinsics @ in_camera)
            y, x = np.indices(size[::-1])
            scale = np.stack([x, y, np.ones_like(x)], axis=-1) @ texel[2]
            picture[shown], depth_m[shown] = seen[shown], (1.0 / scale)[shown]
        return picture, depth_m


def drive(poses: NDArray[np.float64], seed: int = 0) -> Drive:
    """Pictures of smooth noise on both walls."""
    rng = np.random.default_rng(seed)
    walls = []
    for depth_m, height_m in ((2.2, 4.0), (1.3, 1.5)):
        noise = rng.uniform(0, 255, (int(height_m * TEXELS_PER_M), int(10 * TEXELS_PER_M))).astype(np.float32)
        smooth = cv2.GaussianBlur(noise, (0, 0), 3.0) + 0.5 * cv2.GaussianBlur(noise, (0, 0), 8.0)
        walls.append(Wall(depth_m, cv2.normalize(smooth, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)))
    return Drive(tuple(walls), poses)


def sideways(n: int, step_m: float = 0.05, pace: float = 1.0) -> NDArray[np.float64]:
    """A drive along the walls that bumps a little; at a lower pace more pictures are taken of the same."""
    poses = []
    for row in pace * np.arange(n):
        turn, _ = cv2.Rodrigues(np.array([0.01 * np.sin(row), 0.02 * np.sin(0.5 * row), 0.01 * np.cos(0.8 * row)]))
        pose = _translation((step_m * row, 0.01 * np.sin(row), 0.02 * np.sin(0.3 * row)))
        pose[:3, :3] = turn
        poses.append(pose)
    return np.linalg.inv(poses[0]) @ np.array(poses)


def _translation(shift: tuple[float, float, float]) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, 3] = shift
    return pose
