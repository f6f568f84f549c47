"""The index of a map and its answers, for clouds of anything."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np

from fuzz.drawn import REFUSALS, Drawn, look_at
from pomona import _core


def seeds() -> list[bytes]:
    """Bytes to draw from."""
    return [bytes([draw]) for draw in range(32)]


def target(content: bytes) -> None:
    """Index a map and ask it."""
    with contextlib.suppress(*REFUSALS), np.errstate(all="ignore"):
        _search(Drawn(content))


def cloud(draw: Drawn) -> dict[str, Any]:
    n = draw.count()
    views = draw.choice(None, None, draw.count())
    return {
        "positions": draw.numbers(n, 3),
        "covariances": draw.choice(None, draw.covariances(n)),
        "diameters_m": draw.choice(None, np.abs(draw.numbers(n))),
        "view_frames": None if views is None else draw.rows(views, 5),
        "view_fruits": None if views is None else draw.rows(views, n),
    }


def _search(draw: Drawn) -> None:
    index = _core.MapIndex(
        cloud(draw),
        method=draw.choice("verified", "paper", "x"),
        scale=draw.choice("metric", "free"),
        config=draw.config(),
        threads=draw.choice(None, 1, 2),
    )
    query, noise_m = cloud(draw), draw.choice(None, None, draw.positive())
    if draw.choice(False, False, False, True):
        found = _core.match_expected(
            *map(_core.ReadyCloud, (query, cloud(draw))),
            map_from_query=draw.pose(),
            config=draw.config(),
            noise_m=noise_m,
            threads=1,
        )
    elif draw.choice(False, False, True):
        found = index.pairs_under(query, map_from_query=draw.pose(), noise_m=noise_m)
    else:
        up = draw.choice(None, ([0.0, 0.0, 1.0], draw.numbers(3).tolist()))
        found = index.search(query, noise_m=noise_m, up=up, per_frame=draw.choice(False, False, True))
    look_at(found)
