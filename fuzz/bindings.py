"""Functions of `pomona._core` with arrays of anything; what has a state has a target of its own, as `matching`."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from fuzz.drawn import REFUSALS, Drawn
from pomona import _core


def seeds() -> list[bytes]:
    """A byte for each function, and bytes to draw from."""
    return [bytes([number, draw]) for number in range(len(_CALLS)) for draw in range(8)]


def target(content: bytes) -> None:
    """Call one function."""
    call = _CALLS[content[0] % len(_CALLS)] if content else _default_config
    with contextlib.suppress(*REFUSALS), np.errstate(all="ignore"):
        call(Drawn(content))


def _default_config(_: Drawn) -> None:
    json.loads(_core.default_config())


def _adjust(draw: Drawn) -> None:
    k, p = draw.count() % 6, draw.count()
    _core.adjust(
        draw.poses(k),
        draw.rows(k, 2).astype(bool),
        draw.numbers(p, 3),
        places=_seen(draw, k, p),
        relative_poses=draw.choice(None, _between(draw, k)),
        pose_covariances=draw.choice(False, True),
    )


def _seen(draw: Drawn, k: int, p: int) -> Any:
    m = draw.count()
    whitenings = draw.covariances(m)
    return {"poses": draw.rows(m, k), "points": draw.rows(m, p), "values": draw.numbers(m, 3), "whitenings": whitenings}


def _between(draw: Drawn, k: int) -> Any:
    m = draw.count() % 5
    information = np.tile(np.eye(6), (m, 1, 1)) * draw.positive()
    rows = {"first": draw.rows(m, k), "second": draw.rows(m, k), "doubtful": draw.rows(m, 2).astype(bool)}
    return {**rows, "first_from_second": draw.poses(m), "information": information}


class _Eyes:
    """Pictures that answer anything."""

    def __init__(self, draw: Drawn) -> None:
        self._draw = draw

    def follow(self, from_px: Any, expected_px: Any) -> Any:
        n = len(from_px)
        places = expected_px + self._draw.choice(0.0, self._draw.number())
        return places, np.ones(n + self._draw.choice(0, 0, 0, 1), bool)

    def find_again(self) -> Any:
        n = self._draw.count()
        return 20 + 10 * self._draw.numbers(n, 3), 100 + 50 * self._draw.numbers(n, 2)

    def measure(self, known_px: Any, disparities_px: Any, per_cell: int) -> Any:
        known = np.column_stack([known_px, disparities_px])
        new = np.array([160.0, 120.0, 15.0]) + 10 * self._draw.numbers(per_cell + self._draw.count(), 3)
        return np.concatenate([known, new]) if new.shape[1:] == (3,) else new


def _follow(draw: Drawn) -> None:
    odometry = _core.Odometry(_camera(draw, 320, 240), config="{}")
    eyes = _Eyes(draw)
    for _ in range(6):
        odometry.take(eyes)
    odometry.skip("unreadable")
    odometry.trajectory()


def _rejoin(draw: Drawn) -> None:
    before, part = draw.count(), draw.count()
    pose = draw.poses(1)
    matrix = pose[0] if pose.shape == (1, 4, 4) else pose
    _core.rejoin(
        (draw.numbers(before, 3), draw.covariances(before)),
        (draw.numbers(part, 3), draw.covariances(part)),
        last=matrix,
        step=[draw.number(), 0.1, 0.0],
        first=np.eye(4),
    )


def _exposure_tables(draw: Drawn) -> None:
    height, width, channels = draw.choice((48, 64, 3), (1, 1, 1), (0, 0, 3), (24, 320, 0))
    _core.exposure_tables(draw.bytes_of(height, width, channels), draw.bytes_of(height, width, channels))


def _row_alignment(draw: Drawn) -> None:
    corners = 100 * draw.numbers(draw.choice(0, 120, 300), 3)
    _core.row_alignment(corners, (320.0, draw.choice(180.0, draw.number())))
    _core.row_reach_px(draw.choice(0, 640, 2**40))


def _disparities(draw: Drawn) -> None:
    shape = draw.choice((0, 0), (1, 1), (3, 40), (24, 32), (48, 64))
    lefts = [draw.bytes_of(*shape) for _ in range(draw.choice(1, 1, 0, 3))]
    rights = [draw.bytes_of(*draw.choice(shape, shape, (3, 40))) for _ in range(draw.choice(len(lefts), 1))]
    points = draw.numbers(draw.count(), draw.choice(2, 2, 3, 0)) * 20
    _core.Looking("{}").disparities(lefts, rights, points, draw.choice(0.0, 1.0, 10.0, 2.0**40, draw.number()))


def _describe(draw: Drawn) -> None:
    _core.describe(
        draw.numbers(draw.count(), draw.choice(3, 3, 3, 0)),
        draw.choice(4, 5, 6, 7, 0, 2**40),
        draw.choice(5, 8, 0, 1, 2**40),
    )


def _fuse_fruits(draw: Drawn) -> None:
    n, k = draw.count(), draw.count() % 6
    sightings: Any = {
        "frames": draw.rows(n, k),
        "fruits": draw.choice(np.arange(n), draw.rows(n, n)),
        "centres_in_camera": draw.numbers(n, 3) + np.array([0, 0, 3.0]),
        "covariances": draw.covariances(n),
        "diameters_m": np.abs(draw.numbers(n)) * 0.07,
        "diameter_sigmas_m": np.abs(draw.numbers(n)) * 0.01,
        "hidden": draw.numbers(n),
    }
    _core.fuse_fruits(sightings, draw.poses(k))


def _camera(draw: Drawn, width: int, height: int) -> Any:
    size = (draw.choice(width, width, width, 2**62, 0), draw.choice(height, height, height, -1))
    focal_px, cy = 60.0 * draw.positive(), height / 2 + draw.number()
    baseline_m = draw.choice(0.12, 0.12, 0.12 * draw.positive(), None)
    optics = {"fx": focal_px, "fy": 60.0, "cx": width / 2, "cy": cy, "baseline_m": baseline_m}
    return SimpleNamespace(width=size[0], height=size[1], **optics)


def _boxes(draw: Drawn, n: int) -> Any:
    corners = draw.numbers(n, 2) * 10 + 16
    return np.hstack([corners, corners + draw.choice(12.0, 12.0, 0.0, -3.0, 1e9)]) if corners.ndim == 2 else corners


def _lift(draw: Drawn) -> None:
    height, width = draw.choice((48, 64), (1, 1), (0, 0), (24, 32))
    depth = (1.5 + 0.01 * draw.numbers(height, width)).astype(np.float32) * draw.choice(1, 1, 0)
    n = draw.count()
    _core.lift(depth, _boxes(draw, n), np.abs(draw.numbers(n, 3)), _camera(draw, width, height))


def _read_pair(draw: Drawn) -> None:
    height, width = draw.choice((48, 64), (1, 1), (0, 0), (24, 32))
    left = draw.bytes_of(height, width, 3)
    right = np.roll(left, -draw.choice(5, 0), axis=1) if left.ndim == 3 else left
    _core.read_pair(
        np.ascontiguousarray(left),
        right,
        _boxes(draw, draw.count()),
        _camera(draw, width, height),
        nearest_m=draw.choice(0.3, draw.number()),
    )


def _render(draw: Drawn) -> None:
    fruits, limbs, leaves = (draw.choice(0, 1, 3, 8) for _ in range(3))
    geometry = SimpleNamespace(
        fruits=_arrays(
            draw,
            fruits,
            vectors=("centres_m", "axes", "ground_colours", "blush_colours", "blush_directions"),
            numbers=("diameters_m", "heights_m", "blush_shares"),
        ),
        limbs=_arrays(draw, limbs, vectors=("starts_m", "ends_m", "colours"), numbers=("start_radii_m", "end_radii_m")),
        leaves=_arrays(
            draw,
            leaves,
            vectors=("bases_m", "tips", "normals", "colours"),
            numbers=("lengths_m", "widths_m", "folds_rad", "bends_rad"),
        ),
    )
    geometry.fruits.ids = draw.rows(fruits, 100)
    colours = {name: (1.0, draw.number(), 0.5) for name in ("sun_colour", "sky_colour", "horizon_colour")}
    angles = {"sun_elevation_rad": draw.number(), "sun_azimuth_rad": draw.number()}
    weather = SimpleNamespace(sun_strength=draw.positive(), wind_m=draw.choice(0.0, draw.number()), **colours, **angles)
    scene = _core.RowScene(geometry, _camera(draw, 32, 24), draw.poses(2), weather, seed=draw.choice(0, 2**32 - 1, -1))
    scene.pair(np.array(draw.pose()), draw.choice(0, 2**32 - 1))


def _arrays(draw: Drawn, n: int, *, vectors: tuple[str, ...], numbers: tuple[str, ...]) -> Any:
    arrays = {name: draw.numbers(n, 3) for name in vectors} | {name: draw.numbers(n) for name in numbers}
    return SimpleNamespace(**arrays)


_CALLS: tuple[Callable[[Drawn], None], ...] = (
    *(_adjust, _follow, _disparities, _describe, _fuse_fruits, _lift, _read_pair, _default_config),
    *(_rejoin, _exposure_tables, _row_alignment, _render),
)
