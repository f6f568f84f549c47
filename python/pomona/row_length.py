"""Whether a row is as long in one visit as in another: metres that are wrong fit the fruits all the same."""

from __future__ import annotations

import numpy as np

from pomona.answer import Match
from pomona.cloud import FruitCloud

__all__ = ["WRONG_METRES", "length_in_map", "length_told", "off_told"]

STRETCHES = 10
"""Into so many stretches of equally many pairs a row is cut: fruits of one are off by the same bend, and count once."""

LEAST_PAIRS = 5 * STRETCHES
"""Pairs that are asked."""

LEAST_OFF, LEAST_M = 0.02, 0.08
"""Of a length, what is told: cameras that find their own way drift by as much as 1.5 %, and within a tree or two
branches that sag change it by some centimetres."""

LEAST_SIGMAS = 5.0
"""Standard errors that it must be off by, so that a bend is not taken for it."""

SURE = 0.5
"""Probability of the pairs that are asked."""

WRONG_METRES = (
    "one of both has wrong metres, as of a baseline, a focal length or a unit of depth that is not the camera's"
)


def length_in_map(match: Match, query: FruitCloud, map: FruitCloud) -> float | None:
    """Return how long the row is in the map for each metre in the query, where that is not 1.

    The places of the partners along the row are regressed on those in the query, stretch by stretch.

    Returns
    -------
    float or None
        None where the row is as long in both as far as its bends let tell; where too few pairs say so; where the query
        is torn apart, or was found with a scale of its own.
    """
    pairs = match.pairs[match.probabilities >= SURE]
    if match.n_parts != 1 or match.scale is None or abs(match.scale - 1.0) > 1e-9 or len(pairs) < LEAST_PAIRS:
        return None
    seen, there = query.positions[pairs[:, 0]], map.positions[pairs[:, 1]]
    extent = np.linalg.svd(seen - seen.mean(axis=0), full_matrices=False)[2][0]
    assert match.map_from_query is not None
    along = (seen - seen.mean(axis=0)) @ extent
    along_there = (there - there.mean(axis=0)) @ (match.map_from_query[:3, :3] @ extent)
    stretches = np.array_split(np.argsort(along, kind="stable"), STRETCHES)
    x, y = (np.array([np.median(values[rows]) for rows in stretches]) for values in (along, along_there))
    x, y = x - x.mean(), y - y.mean()
    length = float(x @ y / (x @ x))
    error = float(np.sqrt(np.sum((y - length * x) ** 2) / (STRETCHES - 2) / (x @ x)))
    off = abs(length - 1.0)
    return length if off > max(LEAST_OFF, LEAST_M / np.ptp(along), LEAST_SIGMAS * error) else None


def length_told(length: float, query: str, map: str) -> str:
    """Say it of two visits with these names; which of both has wrong metres they cannot tell."""
    return f"the row is {off_told(length)} in {query} than in {map}: {WRONG_METRES}"


def off_told(length: float) -> str:
    """Say by how much what is so long in the map for each metre is longer or shorter where it was seen."""
    return f"{1.0 / length - 1.0:.0%} longer" if length < 1.0 else f"{1.0 - 1.0 / length:.0%} shorter"
