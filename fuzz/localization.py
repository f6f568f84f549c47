"""A map in which cameras find themselves, for clouds and motions of anything."""

from __future__ import annotations

import contextlib

import numpy as np

from fuzz.drawn import REFUSALS, Drawn, look_at
from fuzz.matching import cloud
from pomona import _core


def seeds() -> list[bytes]:
    """Bytes to draw from."""
    return [bytes([draw]) for draw in range(32)]


def target(content: bytes) -> None:
    """Make a map and drive through it."""
    with contextlib.suppress(*REFUSALS), np.errstate(all="ignore"):
        _drive(Drawn(content))


def _drive(draw: Drawn) -> None:
    localizer = _core.Localizer(cloud(draw), config=draw.config(), threads=_threads(draw.choice(None, 1, 2)))
    up = draw.choice(None, ([0.0, 0.0, 1.0], draw.numbers(3).tolist()))
    look_at(localizer.locate(cloud(draw), up=up))
    for _ in range(draw.choice(1, 4, 12)):
        moved, spread = draw.choice(None, np.array(draw.pose())), draw.numbers(36).reshape(6, 6)
        spread = draw.choice(None, spread.tolist(), (spread @ spread.T).tolist())
        look_at(localizer.update(cloud(draw), previous_from_camera=moved, motion_covariance=spread, up=up))
    localizer.reset()


def _threads(count: int | None) -> _core.Threads | None:
    return None if count is None else _core.Threads(count)
