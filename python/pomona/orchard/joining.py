"""Sessions into the tables of a map, with all that follows from them and those that are there."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pomona.orchard.evidence import Evidence, KnownVisit
from pomona.orchard.growth_of_fruits import write_growth
from pomona.orchard.session import Session
from pomona.orchard.settling import SettledPart, Settlement, settle, settlement_of
from pomona.orchard.tree_tables import follow_trees, trees_of
from pomona.orchard.writing import (
    Placement,
    insert_crops,
    insert_matches,
    insert_observations,
    insert_session,
    update_layers,
)
from pomona.store.rows import columns_of, one_of

__all__ = ["Newcomer", "join"]


@dataclass(frozen=True, eq=False)
class Newcomer:
    """A session that is not in the map yet.

    Attributes
    ----------
    session : Session
    placement : Placement, optional
        How it was found; None for one that starts a part.
    content_sha256 : str
        Of what was seen, when it was seen.
    """

    session: Session
    placement: Placement | None
    content_sha256: str


def join(connection: sqlite3.Connection, together: Evidence, newcomers: Mapping[int, Newcomer]) -> Settlement:
    """Write sessions and all that follows from them with the others; return it, as the map has it now.

    Parameters
    ----------
    connection
        The map.
    together
        The parts of the map that something comes to, the new visits among the others.
    newcomers
        By the numbers that the new visits have for now, 0 or less.
    """
    settlement = settlement_of(connection, together)
    # Fruits come after their observations: where they hang, the last observation says.
    connection.execute("PRAGMA defer_foreign_keys = ON")
    known = {number: _inserted(connection, settlement, number, who) for number, who in newcomers.items()}
    parts = [_with_known(part, known) for part in settlement.parts]
    added = {visit.session_id for visit in known.values()}
    for part in parts:
        _insert_matches(connection, part.evidence)
    settlement = replace(settlement, parts=parts)
    trees_before = trees_of(connection, settlement.before)
    settle(connection, settlement)
    own = [part.fruit_ids_of(number) for part, number in map(settlement.part_with, sorted(added))]
    write_growth(connection, (one for ids in own for one in ids.tolist()), settlement.changes)
    touched = settlement.before | settlement.after
    follow_trees(connection, touched, trees_before)
    update_layers(connection, touched)
    return settlement


def _inserted(connection: sqlite3.Connection, settlement: Settlement, number: int, who: Newcomer) -> KnownVisit:
    """Write a session and what it saw; return it as the map holds it."""
    part, own = settlement.part_with(number)
    frame = part.conclusion.frames[own]
    fruit_ids = part.fruit_ids_of(own)
    session_id = insert_session(connection, who.session, frame, who.placement, who.content_sha256)
    observation_ids = insert_observations(connection, session_id, fruit_ids, who.session.cloud.transformed(frame))
    insert_crops(connection, session_id, observation_ids, who.session.crops)
    return replace(
        part.evidence.visits[own],
        session_id=session_id,
        map_from_session=frame,
        observation_ids=observation_ids,
        fruit_ids=fruit_ids,
        match_probabilities=np.full(len(fruit_ids), np.nan),
        match_distances_m=np.full(len(fruit_ids), np.nan),
    )


def _with_known(part: SettledPart, known: Mapping[int, KnownVisit]) -> SettledPart:
    visits = [known.get(visit.session_id, visit) for visit in part.evidence.visits]
    return replace(part, evidence=replace(part.evidence, visits=visits))


def _insert_matches(connection: sqlite3.Connection, evidence: Evidence) -> None:
    """Note how sessions match one another, where the map does not know it yet."""
    names = ("first_session_id", "second_session_id")
    own = one_of("first_session_id", (visit.session_id for visit in evidence.visits))
    known = set(zip(*columns_of(connection, "matches", names, own), strict=True))
    for pair in evidence.pairs:
        one, other = evidence.visits[pair.first], evidence.visits[pair.second]
        if (one.session_id, other.session_id) not in known:
            ids = (one.session_id, other.session_id), (one.observation_ids, other.observation_ids)
            insert_matches(connection, pair, *ids)
