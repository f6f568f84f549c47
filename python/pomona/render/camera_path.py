"""Where the camera goes along the row, and how it shakes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pomona.errors import PomonaError
from pomona.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

__all__ = ["PATHS", "PathShape", "camera_path", "pairs_along"]

RATE_HZ = 10.0
"""Pairs a second, where nothing else is asked for."""

AGAIN_M = 1.5
"""How far a way around goes on past where it began: what the first pictures saw is in view once more."""

SHAKES = 5
"""Sine waves of which each shake is made."""


@dataclass(frozen=True)
class PathShape:
    """A way along the row: how far from it, how fast, how steady.

    Attributes
    ----------
    speed_m_s
        Along the row; below 0 it is driven the other way.
    distance_m, height_m
        From the trunks and over the ground.
    from_behind
        Whether the camera stands on the row's other side.
    around
        Whether it goes on around the end of the row, back along the other side and around to past where it began.
    yaw_rad, pitch_rad, roll_rad
        Turned to the right, up and clockwise against looking straight at the row.
    shake_m, shake_rad
        Standard deviation of the shake of place and direction.
    shake_hz
        Slowest and fastest wave of the shake.
    haste
        By what share of the speed it varies; above 1 the camera at times goes back.
    """

    speed_m_s: float = 1.8
    distance_m: float = 1.5
    height_m: float = 1.4
    from_behind: bool = False
    around: bool = False
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    shake_m: float = 0.004
    shake_rad: float = 0.004
    shake_hz: tuple[float, float] = (0.3, 2.5)
    haste: float = 0.05


_TRACTOR = PathShape()
_BY_HAND = replace(
    _TRACTOR,
    speed_m_s=0.9,
    distance_m=1.35,
    height_m=1.5,
    shake_m=0.03,
    shake_rad=0.035,
    shake_hz=(0.2, 1.2),
    haste=0.6,
)

PATHS: Mapping[str, PathShape] = {
    "tractor": _TRACTOR,
    "tractor-back": replace(_TRACTOR, speed_m_s=-1.8, height_m=1.55),
    "fast": replace(_TRACTOR, speed_m_s=3.0, shake_m=0.006, shake_rad=0.006),
    "hand-held": _BY_HAND,
    "far": replace(_TRACTOR, distance_m=2.3, height_m=1.6, speed_m_s=-1.8),
    "other-side": replace(_TRACTOR, from_behind=True),
    "around": replace(_TRACTOR, around=True),
    "angle": replace(_TRACTOR, yaw_rad=0.3, pitch_rad=0.12, height_m=1.2),
    "walking-far": replace(_BY_HAND, distance_m=2.3, height_m=1.6, speed_m_s=-0.9),
    "upside-down": replace(_TRACTOR, roll_rad=np.pi),
    "upside-down-back": replace(_TRACTOR, roll_rad=np.pi, speed_m_s=-1.8, height_m=1.55),
}
"""By name."""


def pairs_along(path: str, reach_m: tuple[float, float]) -> int:
    """Give the number of pairs that a path takes from one x to another."""
    shape = _shape(path)
    return max(2, round(_length_m(shape, reach_m) / abs(shape.speed_m_s) * RATE_HZ))


def camera_path(path: str, reach_m: tuple[float, float], pairs: int, seed: int, *, jitter: float = 0.0) -> Trajectory:
    """Give the poses of the left camera along a path.

    Parameters
    ----------
    path
        One of `PATHS`.
    reach_m
        First and last x of the row.
    pairs
        Poses, spread over the whole way.
    seed
        Of the shake.
    jitter
        How much distance, height and direction may differ from the path's own, 0 to 1: 1 is 30 cm and 10 degrees.

    Raises
    ------
    PomonaError
        If no path has this name.
    """
    shape, rng = _shape(path), np.random.default_rng([seed, 0xCA3])
    shape = _jittered(shape, rng, jitter)
    length_m = _length_m(shape, reach_m)
    times_s = np.linspace(0.0, length_m / abs(shape.speed_m_s), pairs)
    share = _share_of_way(shape, rng, pairs)
    nearest, towards = _way(shape, reach_m, length_m * (share if shape.speed_m_s > 0 else 1.0 - share))
    places = nearest - shape.distance_m * towards + [0.0, 0.0, shape.height_m]
    poses = np.tile(np.eye(4), (pairs, 1, 1))
    poses[:, :3, 3] = places + shape.shake_m * _shake(rng, times_s, shape)
    angles = np.array([shape.yaw_rad, shape.pitch_rad, shape.roll_rad]) + shape.shake_rad * _shake(rng, times_s, shape)
    poses[:, :3, :3] = _looking(towards, angles)
    return Trajectory(np.arange(pairs), times_s, poses)


def _shape(path: str) -> PathShape:
    if path not in PATHS:
        raise PomonaError(f"no path is called {path!r}; expected one of {', '.join(PATHS)}")
    return PATHS[path]


def _length_m(shape: PathShape, reach_m: tuple[float, float]) -> float:
    along_m = reach_m[1] - reach_m[0]
    return 2.0 * (along_m + np.pi * shape.distance_m) + AGAIN_M if shape.around else along_m


def _way(
    shape: PathShape, reach_m: tuple[float, float], gone_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give where on the row the camera looks, and in which direction, (N, 3) each, level, after it has gone so far.

    Around an end it looks at the last fruit from all along half a circle.
    """
    along_m, bend_m = reach_m[1] - reach_m[0], np.pi * shape.distance_m
    pieces_m = np.array([along_m, bend_m, along_m, bend_m])
    since_m = np.mod(gone_m, pieces_m.sum())[:, None] - (np.cumsum(pieces_m) - pieces_m)
    there_m, round_far_m, back_m, round_near_m = np.clip(since_m, 0.0, pieces_m).T
    turned = (round_far_m + round_near_m) / shape.distance_m + (np.pi if shape.from_behind else 0.0)
    nearest, towards = np.zeros((2, len(gone_m), 3))
    nearest[:, 0] = reach_m[0] + there_m - back_m
    towards[:, 0], towards[:, 1] = -np.sin(turned), np.cos(turned)
    return nearest, towards


def _jittered(shape: PathShape, rng: np.random.Generator, jitter: float) -> PathShape:
    nearer, higher, *turned = jitter * rng.uniform(-1.0, 1.0, 5)
    yaw, pitch, roll = (0.17 * turn for turn in turned)
    return replace(
        shape,
        distance_m=shape.distance_m + 0.3 * nearer,
        height_m=shape.height_m + 0.3 * higher,
        yaw_rad=shape.yaw_rad + yaw,
        pitch_rad=shape.pitch_rad + pitch,
        roll_rad=shape.roll_rad + 0.5 * roll,
    )


def _share_of_way(shape: PathShape, rng: np.random.Generator, pairs: int) -> NDArray[np.float64]:
    """Give the share of the way at each pair, from 0 to 1, at a speed that varies smoothly."""
    even = np.linspace(0.0, 1.0, pairs)
    waves = rng.integers(2, 7)
    # The derivative of the sine is the share by which the speed varies.
    return np.asarray(even + shape.haste / (2.0 * np.pi * waves) * np.sin(2.0 * np.pi * waves * even))


def _shake(rng: np.random.Generator, times_s: NDArray[np.float64], shape: PathShape) -> NDArray[np.float64]:
    """Three smooth motions of standard deviation 1, (N, 3)."""
    rates_hz = rng.uniform(*shape.shake_hz, (SHAKES, 3))
    phases = rng.uniform(0.0, 2.0 * np.pi, (SHAKES, 3))
    waves = np.sin(2.0 * np.pi * rates_hz * times_s[:, None, None] + phases)
    return np.asarray(waves.sum(axis=1) * np.sqrt(2.0 / SHAKES))


def _looking(towards: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations `session_from_camera` of cameras that look level along (N, 3), turned by (N, 3) yaw, pitch and roll."""
    from scipy.spatial.transform import Rotation

    down = np.broadcast_to([0.0, 0.0, -1.0], towards.shape)
    straight = np.stack([np.cross(down, towards), down, towards], axis=2)
    return np.asarray(straight @ Rotation.from_euler("YXZ", angles).as_matrix())
