"""The parts of a map that a session saw: one most often; where it saw more than one, it joins them."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.identity import VisitPair
from pomona.orchard.evidence import Evidence, KnownVisit, read_evidence
from pomona.orchard.parts import parts_of_map, parts_with
from pomona.orchard.recognising import (
    MARGIN_M,
    Recognised,
    matches_between,
    matches_with_visits,
    recognised,
    seen_last_by,
)
from pomona.settings import Settings
from pomona.store.rows import columns_of

__all__ = ["SeenPart", "matches_with_parts", "seen_parts"]

LEAST_BEYOND = 12
"""Fruits of a session beyond a part for which another part is looked for: fewer are hardly found anywhere."""

MOST_SHARED = 0.5
"""Of the fruits of a session found in either of two parts, those that are found in both where they overlap."""


@dataclass(frozen=True, eq=False)
class SeenPart:
    """A part of the map in which a session, or what it saw beyond other parts, was found.

    Attributes
    ----------
    evidence : Evidence
        Of the part.
    found : Recognised
    rows : (N,) int64
        Of the session, that were looked for.
    """

    evidence: Evidence
    found: Recognised
    rows: NDArray[np.int64]

    @property
    def map_from_session(self) -> NDArray[np.float64]:
        """Where the session lies by this part, as the part lies now."""
        assert self.found.match.map_from_query is not None
        return self.found.match.map_from_query


def seen_parts(
    connection: sqlite3.Connection, cloud: FruitCloud, found: Recognised, settings: Settings
) -> list[SeenPart]:
    """Return the part in which a session was found, and others in which lies what it saw beyond; none where in none.

    How parts lie to each other nobody knows, so a session that saw two has two poses in the map: it is torn apart
    there, or neither pose stands out of the other. Then each part is asked by itself.
    """
    if found.match.status.value == "Ambiguous" or _is_outdone(found):
        return _asked_apart(connection, cloud, settings)
    if found.match.n_parts > 1 and (apart := _asked_apart(connection, cloud, settings)):
        return apart
    rows, parts = np.arange(len(cloud)), list[SeenPart]()
    while found.is_found:
        evidence = read_evidence(connection, parts_with(connection, seen_last_by(connection, found)))
        parts.append(SeenPart(evidence, found, rows))
        rows = rows[_are_beyond(parts[-1], cloud.select(rows))]
        others = _other_sessions(connection, parts)
        if len(rows) < LEAST_BEYOND or not others:
            break
        found = recognised(connection, cloud.select(rows), settings, others)
    return parts


def _is_outdone(found: Recognised) -> bool:
    """Whether there would be a pose but for another that is as good."""
    return found.match.status.value == "NoMatch" and dict(found.match.stages).get("rivals") == 1.0


def _asked_apart(connection: sqlite3.Connection, cloud: FruitCloud, settings: Settings) -> list[SeenPart]:
    """Return the parts that have, each by itself, other fruits of a session; none where two have the same ones."""
    of_map, parts, rows = parts_of_map(connection), list[SeenPart](), np.arange(len(cloud))
    for session_ids in of_map if len(of_map) > 1 else []:
        found = recognised(connection, cloud, settings, session_ids)
        if found.is_found:
            parts.append(SeenPart(read_evidence(connection, session_ids), found, rows))
    return [] if any(_tell_the_same(*both) for both in combinations(parts, 2)) else parts


def _tell_the_same(first: SeenPart, second: SeenPart) -> bool:
    """Tell whether two parts have the same fruits of a session: then it is one of them that it saw."""
    one, other = (set(part.found.match.pairs[:, 0].tolist()) for part in (first, second))
    return len(one & other) > MOST_SHARED * min(len(one), len(other))


def _are_beyond(part: SeenPart, cloud: FruitCloud) -> NDArray[np.bool_]:
    """Tell which fruits have none of the part near them."""
    from scipy.spatial import cKDTree

    in_map = np.concatenate([visit.places_in_map for visit in part.evidence.visits])
    asked = cloud.transformed(part.map_from_session).positions
    # Asked once: a tree that is built in no time serves better than one that answers in no time.
    tree = cKDTree(in_map, balanced_tree=False, compact_nodes=False)
    distances_m, _ = tree.query(asked, distance_upper_bound=MARGIN_M)
    return np.isinf(distances_m)


def _other_sessions(connection: sqlite3.Connection, parts: Sequence[SeenPart]) -> list[int]:
    (session_ids,) = columns_of(connection, "sessions", ("id",))
    known = {visit.session_id for part in parts for visit in part.evidence.visits}
    return [session_id for session_id in session_ids if session_id not in known]


def matches_with_parts(
    parts: Sequence[SeenPart], visit: KnownVisit, settings: Settings
) -> tuple[Evidence, dict[int, VisitPair]]:
    """Return what all parts say together, and how a visit matches the visits of each, by their numbers there.

    Visits of two parts are matched with one another, as they would have been had the visit come before them.
    """
    across = [pair for first, second in combinations(parts, 2) for pair in _across(first, second, settings)]
    together = Evidence.of_parts([part.evidence for part in parts], across)
    matches = {
        together.number_of(part.evidence.visits[number].session_id): pair
        for part in parts
        for number, pair in matches_with_visits(part.evidence, visit, part.found, settings, part.rows).items()
    }
    return together, matches


def _across(first: SeenPart, second: SeenPart, settings: Settings) -> list[tuple[int, int, VisitPair]]:
    """Return how visits of two parts match, with the sessions of both, the earlier one first."""
    first_from_second = first.map_from_session @ np.linalg.inv(second.map_from_session)
    across = []
    for visit in second.evidence.visits:
        laid = first_from_second @ visit.map_from_session
        for number, pair in matches_between(first.evidence, visit, laid, settings).items():
            both = sorted((visit, first.evidence.visits[number]), key=lambda one: one.seen.key)
            across.append((both[0].session_id, both[1].session_id, pair))
    return across
