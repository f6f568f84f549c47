"""Every function and class of `pomona._core`, called with arrays of anything."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from fuzz.drawn import Drawn
from pomona import _core

CONFIG = _core.default_config()

REFUSALS = (ValueError, TypeError, OverflowError)
"""How the bindings say that an argument is wrong."""


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


def _cloud(draw: Drawn) -> dict[str, Any]:
    n = draw.count()
    views = draw.choice(None, None, draw.count())
    return {
        "positions": draw.numbers(n, 3),
        "covariances": draw.choice(None, draw.covariances(n)),
        "diameters_m": draw.choice(None, np.abs(draw.numbers(n))),
        "view_frames": None if views is None else draw.rows(views, 5),
        "view_fruits": None if views is None else draw.rows(views, n),
    }


def _config(draw: Drawn) -> str:
    """Settings, now and then with one that is absurd."""
    config = json.loads(CONFIG)
    if draw.choice(False, False, True):
        table = draw.choice(*(value for value in config.values() if isinstance(value, dict)))
        name = draw.choice(*table)
        table[name] = draw.choice(0, -1, 1, 1e300, -0.5, 1e-300, 2**40, None, "x", True, [], table[name])
    return json.dumps(config)


def _map_index(draw: Drawn) -> None:
    index = _core.MapIndex(
        _cloud(draw),
        method=draw.choice("verified", "paper", "x"),
        scale=draw.choice("metric", "free"),
        config=_config(draw),
        threads=draw.choice(None, 1, 2),
    )
    query, noise_m = _cloud(draw), draw.choice(None, None, draw.positive())
    if draw.choice(False, False, True):
        found = index.pairs_under(query, map_from_query=draw.poses(1)[0].tolist(), noise_m=noise_m)
    else:
        up = draw.choice(None, ([0.0, 0.0, 1.0], draw.numbers(3).tolist()))
        found = index.search(query, noise_m=noise_m, up=up, per_frame=draw.choice(False, False, True))
    _look_at(found)


def _look_at(found: Any) -> None:
    """Ask for all that an answer has."""
    for name in dir(found):
        if not name.startswith("_"):
            getattr(found, name)


def _tracker(draw: Drawn) -> None:
    tracker = _core.Tracker(
        focal_px=(draw.positive() * 500, 500.0),
        principal_px=(320.0, 240.0 + draw.number()),
        size_px=(640.0, 480.0 * draw.positive()),
        config=_config(draw),
    )
    for step in range(draw.choice(1, 2, 5)):
        n = draw.count()
        m = draw.choice(n, n, n // 2)
        corners = 200 + 50 * draw.numbers(n, 2)
        boxes_px = np.hstack([corners, corners + draw.choice(40, 40, -1)]) if corners.ndim == 2 else corners
        lifted: Any = {
            "rows": np.arange(m) if draw.choice(True, True, False) else draw.rows(m, n),
            "centres_in_camera": draw.numbers(m, 3) + [0, 0, 2.0],
            "covariances": draw.covariances(m),
            "diameters_m": np.abs(draw.numbers(m)) * 0.07,
            "diameter_sigmas_m": np.abs(draw.numbers(m)) * 0.01,
            "support": np.abs(draw.numbers(m)).clip(0, 1),
        }
        pose = draw.poses(1)
        frame = draw.choice(step, step, step, -step, 2**62)
        tracker.update(
            frame, pose[0].tolist() if len(pose) else [], boxes_px, np.abs(draw.numbers(n)).clip(0, 1), lifted
        )
    _look_at(tracker.finish(draw.choice(None, 0, 1, 2**40)))


def _one_fruit_each(draw: Drawn) -> None:
    n, m = draw.count(), draw.count()
    _core.one_fruit_each(
        centres=draw.numbers(n, 3),
        covariances=draw.covariances(n),
        radii_m=np.abs(draw.numbers(n)),
        frames=draw.rows(m, 5),
        fruits=draw.rows(m, n),
        place_sigma_m=draw.positive(),
        config=_config(draw),
    )


def _adjust(draw: Drawn) -> None:
    k, p = draw.count() % 6, draw.count()
    _core.adjust(
        (500.0, 500.0 * draw.positive(), 320.0, 240.0, 0.12 * draw.positive()),
        draw.poses(k),
        draw.rows(k, 2).astype(bool),
        draw.numbers(p, 3),
        pictures=draw.choice(None, _seen(draw, k, p)),
        places=draw.choice(None, _seen(draw, k, p)),
        relative_poses=draw.choice(None, _between(draw, k)),
        wanted=draw.choice([], [(0, 1)], [(0, 0)], [(5, 2**40)]),
        max_steps=draw.choice(None, 0, 1, 3),
        first_scale=draw.choice(None, draw.number()),
    )


def _seen(draw: Drawn, k: int, p: int) -> Any:
    m = draw.count()
    whitenings = draw.covariances(m)
    return {"poses": draw.rows(m, k), "points": draw.rows(m, p), "values": draw.numbers(m, 3), "whitenings": whitenings}


def _between(draw: Drawn, k: int) -> Any:
    m = draw.count() % 5
    information = np.tile(np.eye(6), (m, 1, 1)) * draw.positive()
    rows = {"first": draw.rows(m, k), "second": draw.rows(m, k)}
    return {**rows, "first_from_second": draw.poses(m), "information": information}


def _locate(draw: Drawn) -> None:
    n = draw.count()
    expected = draw.poses(1)
    _core.locate(
        (500.0, 500.0, 320.0, 240.0, draw.positive()),
        draw.numbers(n, 3) + [0, 0, 3.0],
        draw.covariances(n),
        300 + 50 * draw.numbers(n, 2),
        expected[0].tolist() if expected.shape == (1, 4, 4) else [],
        sigma_px=draw.positive(),
    )


def _search_rows(draw: Drawn) -> None:
    shape = draw.choice((0, 0), (1, 1), (3, 40), (24, 32), (48, 64))
    left, right = draw.bytes_of(*shape), draw.bytes_of(*shape)
    points = draw.numbers(draw.count(), draw.choice(2, 2, 3, 0)) * 20
    _core.search_rows(left, right, points, draw.choice(0, 1, 10, 2**40, -1))


def _describe(draw: Drawn) -> None:
    _core.describe(
        draw.numbers(draw.count(), draw.choice(3, 3, 3, 0)),
        draw.choice(4, 5, 6, 7, 0, 2**40),
        draw.choice(5, 8, 0, 1, 2**40),
    )


def _fuse_centres(draw: Drawn) -> None:
    n = draw.count()
    _core.fuse_centres(draw.numbers(n, 3), draw.covariances(n), draw.numbers(n, 3))


def _fuse_diameters(draw: Drawn) -> None:
    n = draw.count()
    _core.fuse_diameters(np.abs(draw.numbers(n)), np.abs(draw.numbers(n)), draw.numbers(n))


def _camera(draw: Drawn, width: int, height: int) -> Any:
    size = (draw.choice(width, width, width, 2**62, 0), draw.choice(height, height, height, -1))
    fx, fy = 60.0 * draw.positive(), 60.0
    return SimpleNamespace(width=size[0], height=size[1], fx=fx, fy=fy, cx=width / 2, cy=height / 2 + draw.number())


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
        focal_baseline_px_m=7.2 * draw.positive(),
        nearest_m=draw.choice(0.3, draw.number()),
    )


_CALLS: tuple[Callable[[Drawn], None], ...] = (
    *(_map_index, _map_index, _map_index, _tracker, _tracker, _one_fruit_each, _adjust, _locate, _search_rows),
    *(_describe, _fuse_centres, _fuse_diameters, _lift, _read_pair, _default_config),
)
