"""A session against every visit of the map that may have seen the same fruits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona.identity import VisitPair
from pomona.orchard.evidence import Evidence, KnownVisit
from pomona.settings import Settings

if TYPE_CHECKING:
    from pomona.matching import Match

__all__ = ["matches_with_visits"]

MARGIN_M = 0.5
"""Between visits that still are compared: trees sag and trajectories drift by less."""


def matches_with_visits(
    evidence: Evidence, visit: KnownVisit, found: Match, fruit_ids: NDArray[np.int64], settings: Settings
) -> dict[int, VisitPair]:
    """Return how a visit matches each other one in which it was found, by the number of that one.

    Each match asks the two visits alone, the later one as the query, so that it is the same whoever came first. A visit
    that is in none of the others by itself, as only the whole map has enough of its fruits, is matched as it was found
    in the map.

    Parameters
    ----------
    evidence, visit
        The map, and the new visit.
    found, fruit_ids
        Where the visit was found in the map, and the fruits of the map, in its order.
    settings
        Of the match.
    """
    assert found.map_from_query is not None
    asked = Settings({**settings.call, "up": None, "per_frame": False}, settings.overrides)
    in_map = visit.cloud.transformed(found.map_from_query).positions
    matches = {}
    for number, other in enumerate(evidence.visits):
        if _are_apart(in_map, other):
            continue
        is_later = visit.seen.key > other.seen.key
        query, map_ = (visit.cloud, other.cloud) if is_later else (other.cloud, visit.cloud)
        match = asked.match(query, map_)
        if match.status.value == "Found":
            assert match.map_from_query is not None
            matches[number] = VisitPair(
                0, 0, match.map_from_query, match.log_odds, match.pairs[:, ::-1], match.probabilities
            )
    return matches or dict(_as_in_map(evidence, visit, found, fruit_ids))


def _are_apart(in_map: NDArray[np.float64], other: KnownVisit) -> bool:
    """Tell whether two visits saw other places; that takes less than to match them."""
    if not len(other.cloud):
        return True
    others = other.cloud.transformed(other.map_from_session).positions
    low, high = others.min(axis=0) - MARGIN_M, others.max(axis=0) + MARGIN_M
    return bool((in_map.min(axis=0) > high).any() or (in_map.max(axis=0) < low).any())


def _as_in_map(
    evidence: Evidence, visit: KnownVisit, found: Match, fruit_ids: NDArray[np.int64]
) -> Iterator[tuple[int, VisitPair]]:
    """Give the pairs with the fruits of the map, by the visit that saw each of those last."""
    assert found.map_from_query is not None
    last = _last_sights(evidence)
    matched = [last[fruit_id] for fruit_id in fruit_ids[found.pairs[:, 1]].tolist()]
    for number in sorted({number for number, _ in matched}):
        mine = [row for row, (by, _) in enumerate(matched) if by == number]
        rows = np.array([(matched[row][1], found.pairs[row, 0]) for row in mine], np.int64)
        other_from_visit = np.linalg.inv(evidence.visits[number].map_from_session) @ found.map_from_query
        pair = VisitPair(0, 0, other_from_visit, found.log_odds, rows, found.probabilities[mine])
        if visit.seen.key < evidence.visits[number].seen.key:
            pair = replace(
                pair, first_from_second=np.asarray(np.linalg.inv(other_from_visit), np.float64), rows=rows[:, ::-1]
            )
        yield number, pair


def _last_sights(evidence: Evidence) -> Mapping[int, tuple[int, int]]:
    """Return the last visit that saw each fruit, and its row there."""
    return {
        fruit_id: (number, row)
        for number, visit in enumerate(evidence.visits)
        for row, fruit_id in enumerate(visit.fruit_ids.tolist())
    }
