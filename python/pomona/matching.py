"""Which fruit of the query is which fruit of the map: the Python face of the core's matcher."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pomona import _core
from pomona.answer import Match, Verdict
from pomona.cloud import Cloud, Unit, as_cloud
from pomona.cloud.given import doubt_metres
from pomona.expected_match import ReadyCloud, match_expected
from pomona.map_index import Index
from pomona.match_arguments import Method, Scale, Up

__all__ = [
    "Index",
    "Match",
    "Method",
    "ReadyCloud",
    "Scale",
    "Up",
    "Verdict",
    "default_config",
    "match",
    "match_expected",
]


def match(
    query: Cloud,
    map: Cloud,
    *,
    scale: Scale = "metric",
    method: Method = "verified",
    noise_m: float | None = None,
    up: Up | None = None,
    per_frame: bool = False,
    config: Mapping[str, Any] | None = None,
    threads: int | None = None,
) -> Match:
    """Say which fruit of `query` is which fruit of `map`, and where the query lies in the map.

    Parameters
    ----------
    query, map
        Clouds, (N, 3) metres, or names of files with them: .csv, .ply or .gpkg, in metres unless `scale` is "free".
    scale
        "metric" where both clouds are in metres, "free" where the ratio of their scales is unknown.
    method
        "verified", or "paper" for the published method.
    noise_m
        Standard deviation per axis of the difference of the two visits, metres, known to a tenth or so: what the
        verified method begins with, and `Match.noise_m` is what it ends with; the published method takes it as it is.
        None: estimated.
    up
        The vertical in the query's and in the map's frame, or one for both, where it is known to some 5 degrees; a pose
        that leans by more than 10 is refused (verified only: the published method knows no vertical).
    per_frame
        Give each frame of the query a transform of its own and merge their pairs (paper only). The query must know
        which frame saw which fruit.
    config
        Values of the core's tables that differ from `default_config()`; unknown keys are errors.
    threads
        Threads of the search, from 1, of which no more than there are cores are used; None takes all. The answer does
        not depend on it.

    Raises
    ------
    PomonaError
        An array or a setting is wrong. That there is no match is no error: see `Match.status`.

    Warns
    -----
    PomonaWarning
        Where a cloud cannot be in metres, or its numbers go in steps as coarse as fruits are apart.
    """
    start = time.perf_counter()
    unit: Unit = "free" if scale == "free" else "m"
    query, map = as_cloud(query, unit, name="query"), as_cloud(map, unit, name="map")
    if unit == "m":
        doubt_metres("query", query)
        doubt_metres("map", map)
    index = Index(map, scale=scale, method=method, config=config, threads=threads)
    found = index.match(query, noise_m=noise_m, up=up, per_frame=per_frame)
    return replace(found, elapsed_s=time.perf_counter() - start)


def default_config() -> dict[str, Any]:
    """Return the core's settings with their defaults, a table per method."""
    defaults: dict[str, Any] = json.loads(_core.default_config())
    return defaults
