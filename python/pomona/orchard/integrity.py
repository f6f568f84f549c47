"""What must be true of a map, asked of the file."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path

from pomona.amounts import amount
from pomona.orchard.evidence import read_evidence
from pomona.orchard.parts import parts_of_map
from pomona.orchard.settling import FruitRow, fruit_rows, settlement_of
from pomona.store.cells import COLUMNS
from pomona.store.failures import WrongContentError
from pomona.store.numbering import misnumbered
from pomona.store.opening import snapshot
from pomona.store.rows import columns_of, misfits, one_of

__all__ = ["problems"]

# Each query gives one line of text per violation.
INVARIANTS = (
    "SELECT 'fruit ' || id || ' was never observed' FROM fruits WHERE id NOT IN (SELECT fruit_id FROM observations)",
    """SELECT 'fruit ' || fruit_id || ' is there ' || count(*) || ' times in session ' || session_id FROM observations
    GROUP BY fruit_id, session_id HAVING count(*) > 1""",
    """SELECT 'fruit ' || f.id || ' counts ' || n_sessions || ' sessions, observed in ' || count(o.id) FROM fruits f
    JOIN observations o ON o.fruit_id = f.id GROUP BY f.id HAVING count(o.id) != n_sessions""",
    """SELECT 'fruit ' || f.id || ' is not where session ' || s.name || ' saw it last' FROM fruits f
    JOIN sessions s ON s.id = f.last_session_id
    LEFT JOIN observations o ON o.fruit_id = f.id AND o.session_id = s.id
    WHERE o.geom IS NOT f.geom OR s.date != f.last_seen""",
    """SELECT 'fruit ' || f.id || ' was last seen on ' || f.last_seen || ', session ' || s.name || ' saw it later'
    FROM fruits f JOIN observations o ON o.fruit_id = f.id JOIN sessions s ON s.id = o.session_id
    WHERE s.date > f.last_seen""",
    """SELECT 'fruit ' || id || ' is not in the spatial index' FROM fruits
    WHERE id NOT IN (SELECT id FROM rtree_fruits_geom)""",
    """SELECT 'the file of a session holds ' || (SELECT count(*) FROM sessions) || ' sessions' FROM pomona_format
    WHERE kind = 'session' AND (SELECT count(*) FROM sessions) != 1""",
    "SELECT 'the map holds no session' FROM pomona_format WHERE kind = 'map' AND (SELECT count(*) FROM sessions) = 0",
)


def problems(path: str | Path) -> list[str]:
    """Return what is wrong with a session or a map, a line each; nothing when all is well.

    Raises
    ------
    PomonaError
        When the file is not ours, from a newer program or so damaged that it cannot be read.
    """
    with snapshot(Path(path)) as (connection, _):
        damage = [line for (line,) in connection.execute("PRAGMA integrity_check") if line != "ok"]
        try:
            return damage + _contradictions(connection)
        except (sqlite3.Error, UnicodeDecodeError, WrongContentError):
            # Damaged pages need not give more to ask.
            if not damage:
                raise
            return damage


def _contradictions(connection: sqlite3.Connection) -> list[str]:
    wrong = [line for table in COLUMNS for line in misfits(connection, table)]
    broken = [line for query in INVARIANTS for (line,) in connection.execute(query) if line is not None]
    found = wrong + list(_dangling(connection)) + broken + misnumbered(connection)
    return found or list(_unsettled(connection))


def _dangling(connection: sqlite3.Connection) -> Iterator[str]:
    for child in COLUMNS:
        for table, row, parent, _ in connection.execute(f"PRAGMA foreign_key_check({child})"):
            yield f"{table} {row} points to a row of {parent} that is not there"


def _unsettled(connection: sqlite3.Connection) -> Iterator[str]:
    """Compare identities and states with what follows from all sessions; a map of format 1 never was settled."""
    (judged,) = columns_of(connection, "fruits", ("state_probability",))
    if None in judged:
        return
    for session_ids in parts_of_map(connection):
        yield from _unsettled_part(connection, session_ids)


def _unsettled_part(connection: sqlite3.Connection, session_ids: Sequence[int]) -> Iterator[str]:
    settlement = settlement_of(connection, read_evidence(connection, session_ids))
    for change in settlement.changes:
        yield (
            f"fruit {change.from_fruit_id} has {amount(change.n_observations, 'observation')} that from what the "
            f"sessions saw belong to fruit {change.to_fruit_id}"
        )
    if not settlement.changes:
        for part in settlement.parts:
            yield from _misjudged(connection, fruit_rows(connection, part))


def _misjudged(connection: sqlite3.Connection, rows: dict[int, FruitRow]) -> Iterator[str]:
    names = ("state", "n_missed", "last_session_id", "n_sessions")
    told = columns_of(connection, "fruits", ("id", *names), one_of("fruits.id", rows))
    for fruit_id, *found in zip(*told, strict=True):
        _, state, _, last_session_id, n_sessions, n_missed, *_ = rows[fruit_id]
        for name, one, other in zip(names, found, (state, n_missed, last_session_id, n_sessions), strict=True):
            if one != other:
                yield f"fruit {fruit_id} has the {name} {one}, from what the sessions saw follows {other}"
