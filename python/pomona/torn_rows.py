"""A query that is torn apart, because a camera lost its way, laid on the map part by part."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError

if TYPE_CHECKING:
    from pomona.answer import Match
    from pomona.cloud import FruitCloud

__all__ = ["laid_in_parts", "part_of_places", "parts_of_fruits"]

NEIGHBOURS = 5
"""Fruits found again around a place that say to which part it belongs: as many as make a constellation."""


def laid_in_parts(match: Match, query: FruitCloud) -> FruitCloud:
    """Return a query that was found where it lies in the map, each fruit by the pose of its part.

    A fruit that was found again belongs to the part of its pair, another to that of most of the five found again
    next to it. Of a query in one piece all lie by `Match.map_from_query`. Covariances and diameters follow.

    Parameters
    ----------
    match : Match
        The answer to `query`.
    query : FruitCloud
        N fruits.

    Raises
    ------
    PomonaError
        The match found nothing, or is of another query.
    """
    parts = parts_of_fruits(match, query)
    laid = query.transformed(match.parts[0])
    for part, map_from_query in enumerate(match.parts[1:], start=1):
        own, there = parts == part, query.transformed(map_from_query)
        laid = replace(
            laid,
            positions=np.where(own[:, None], there.positions, laid.positions),
            covariances=_either(own[:, None, None], there.covariances, laid.covariances),
            diameters_m=_either(own, there.diameters_m, laid.diameters_m),
        )
    return laid


def _either(
    own: NDArray[np.bool_], there: NDArray[np.float64] | None, here: NDArray[np.float64] | None
) -> NDArray[np.float64] | None:
    return None if there is None or here is None else np.where(own, there, here)


def parts_of_fruits(match: Match, query: FruitCloud) -> NDArray[np.int64]:
    """Return the part of `Match.parts` to which each fruit of a query that was found belongs, (N,).

    Raises
    ------
    PomonaError
        The match found nothing, or is of another query.
    """
    if not match.parts:
        raise PomonaError(f"match: found {match.status.value}, expected one that lays the query on the map")
    if match.n_query != len(query):
        raise PomonaError(f"query: found {len(query)} fruits, expected the {match.n_query} of the match")
    parts = part_of_places(match, query, query.positions)
    parts[match.pairs[:, 0]] = match.part_of_pairs
    return parts


def part_of_places(match: Match, query: FruitCloud, places: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the part to which most of the fruits found again next to each place, (N, 3) in the query, belong, (N,)."""
    from scipy.spatial import cKDTree

    if match.n_parts < 2:
        return np.zeros(len(places), np.int64)
    n_neighbours = min(NEIGHBOURS, len(match.pairs))
    _, nearest = cKDTree(query.positions[match.pairs[:, 0]]).query(places, k=range(1, n_neighbours + 1))
    votes = match.part_of_pairs[nearest][..., None] == np.arange(match.n_parts)
    return np.asarray(votes.sum(axis=1).argmax(axis=1), np.int64)
