"""The tracker and what it settles at the end, for boxes of anything."""

from __future__ import annotations

import contextlib
from types import SimpleNamespace
from typing import Any

import numpy as np

from fuzz.drawn import REFUSALS, Drawn, look_at
from pomona import _core


def seeds() -> list[bytes]:
    """Bytes to draw from."""
    return [bytes([draw]) for draw in range(32)]


def target(content: bytes) -> None:
    """Follow fruits, or say which of them are one."""
    with contextlib.suppress(*REFUSALS), np.errstate(all="ignore"):
        draw = Drawn(content)
        _one_fruit_each(draw) if content[:1] > b"\xc0" else _follow(draw)


def _follow(draw: Drawn) -> None:
    size = {"width": 640, "height": draw.choice(480, 480, 0, 2**40)}
    optics = {"fx": draw.positive() * 500, "fy": 500.0, "cx": 320.0, "cy": 240.0 + draw.number(), "baseline_m": None}
    tracker = _core.Tracker(SimpleNamespace(**size, **optics), config=draw.config())
    for step in range(draw.choice(1, 2, 5)):
        n = draw.count()
        m = draw.choice(n, n, n // 2)
        corners = 200 + 50 * draw.numbers(n, 2)
        boxes_px = np.hstack([corners, corners + draw.choice(40, 40, -1)]) if corners.ndim == 2 else corners
        lifted: Any = {
            "rows": np.arange(m) if draw.choice(True, True, False) else draw.rows(m, n),
            "centres_in_camera": draw.numbers(m, 3) + np.array([0, 0, 2.0]),
            "covariances": draw.covariances(m),
            "diameters_m": np.abs(draw.numbers(m)) * 0.07,
            "diameter_sigmas_m": np.abs(draw.numbers(m)) * 0.01,
            "support": np.abs(draw.numbers(m)).clip(0, 1),
        }
        pose = draw.poses(1)
        frame = draw.choice(step, step, step, -step, 2**62)
        tracker.update(frame, pose[0] if len(pose) else pose, boxes_px, np.abs(draw.numbers(n)).clip(0, 1), lifted)
    look_at(tracker.finish(draw.choice(None, 0, 1, 2**40)))


def _one_fruit_each(draw: Drawn) -> None:
    n, m = draw.count(), draw.count()
    _core.one_fruit_each(
        centres=draw.numbers(n, 3),
        covariances=draw.covariances(n),
        radii_m=np.abs(draw.numbers(n)),
        frames=draw.rows(m, 5),
        fruits=draw.rows(m, n),
        place_sigma_m=draw.positive(),
        config=draw.config(),
    )
