"""A session out of the map again: as if it had never been added, but for the ids, which nobody else gets."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass
from pathlib import Path

from pomona.orchard.evidence import Evidence, read_evidence
from pomona.orchard.fruit_ids import Change
from pomona.orchard.growth_of_fruits import write_growth
from pomona.orchard.parts import parts_with
from pomona.orchard.settling import FruitRow, fruit_rows, settle, settlement_of, write_changes
from pomona.orchard.tree_tables import follow_trees, trees_of
from pomona.orchard.writing import update_layers
from pomona.store.failures import WrongContentError
from pomona.store.opening import TIMEOUT_S, Waiting, writing
from pomona.store.rows import columns_of, one_of

__all__ = ["Removed", "remove_session", "take_out"]

PARTS = (
    "DELETE FROM crops WHERE session_id = :session",
    "DELETE FROM sightings WHERE observation_id IN (SELECT id FROM observations WHERE session_id = :session)",
    "DELETE FROM observations WHERE session_id = :session",
    "DELETE FROM poses WHERE session_id = :session",
    "DELETE FROM matches WHERE :session IN (first_session_id, second_session_id)",
)
"""What belongs to a session, in an order that leaves no row without the one it points to."""


@dataclass(frozen=True)
class Removed:
    """What went.

    Attributes
    ----------
    n_observations : int
        Fruits that the session had seen.
    n_gone : int
        Those that no other session has seen; they are gone.
    n_changed : int
        Fruits that are now where another session saw them, or of another state.
    n_left : int
        Sessions that are left.
    changes : tuple of Change
        Observations of other sessions that now are of another fruit.
    """

    n_observations: int
    n_gone: int
    n_changed: int
    n_left: int
    changes: tuple[Change, ...] = ()


def remove_session(
    path: str | Path, name: str, *, timeout_s: float = TIMEOUT_S, waiting: Waiting | None = None, dry: bool = False
) -> Removed | None:
    """Undo `add_session`: the session, its observations, sightings and poses go, in one transaction.

    Fruits that only it saw go too, and their ids are never given out again. The others fall back to where the last of
    the remaining sessions saw them; identities, hits and misses follow from those. The frame of the map stays, whoever
    goes.

    Parameters
    ----------
    path : str or Path
        The map (.gpkg).
    name : str
        Name of the session.
    timeout_s : float
        How long to wait for another program that is writing to the map.
    waiting : callable, optional
        Called once when it has to wait.
    dry : bool
        Whether only to tell what would go.

    Returns
    -------
    Removed or None
        None when the map has no session of that name; nothing is written then.

    Raises
    ------
    PomonaError
        When the file is not a map of ours, cannot be written, or has no other session: a map has at least one.
    """
    with writing(Path(path), "map", timeout_s=timeout_s, waiting=waiting) as (connection, _):
        ids, names = columns_of(connection, "sessions", ("id", "name"))
        if name not in names:
            return None
        if len(ids) == 1:
            raise WrongContentError(f"{name} is its only session, and a map has at least one: delete the file instead")
        return _remove(connection, name, ids[names.index(name)], dry=dry)


def take_out(connection: sqlite3.Connection, name: str) -> bool:
    """Remove a session, if it is there, inside the open transaction; tell whether the map has sessions left."""
    ids, names = columns_of(connection, "sessions", ("id", "name"))
    if name not in names:
        return True
    if len(ids) > 1:
        _remove(connection, name, ids[names.index(name)], dry=False)
        return True
    for part in (*PARTS, "DELETE FROM fruits", "DELETE FROM sessions"):
        connection.execute(part, {"session": ids[0]})
    return False


def _remove(connection: sqlite3.Connection, name: str, session_id: int, *, dry: bool) -> Removed:
    evidence = read_evidence(connection, parts_with(connection, [session_id]))
    going = evidence.visits[evidence.number_of(session_id)]
    rest = evidence.without_session(session_id)
    (n_sessions,) = connection.execute("SELECT count(*) FROM sessions").fetchone()
    before = _fruits(connection, set(evidence.fruit_ids.tolist()))
    trees_before = trees_of(connection, before)
    if not dry:
        for part in PARTS:
            connection.execute(part, {"session": session_id})
    after, changes = _left(connection, rest, name, dry=dry)
    if not dry:
        connection.executemany("DELETE FROM fruits WHERE id = ?", ((one,) for one in before.keys() - after.keys()))
        connection.execute("DELETE FROM sessions WHERE id = ?", (session_id,))
        write_growth(connection, going.fruit_ids.tolist(), changes)
        touched = before.keys() | after.keys()
        follow_trees(connection, touched, trees_before)
        update_layers(connection, touched)
    n_changed = sum(_place_and_state(row) != before[fruit_id] for fruit_id, row in after.items() if fruit_id in before)
    return Removed(
        n_observations=len(going.cloud),
        n_gone=len(before.keys() - after.keys()),
        n_changed=n_changed,
        n_left=n_sessions - 1,
        changes=tuple(changes),
    )


def _left(
    connection: sqlite3.Connection, rest: Evidence, name: str, *, dry: bool
) -> tuple[dict[int, FruitRow], list[Change]]:
    """Settle what is left of the part, which may have come apart; nothing where the session was all of it."""
    if not rest.visits:
        return {}, []
    settlement = settlement_of(connection, rest)
    after = {fruit_id: row for part in settlement.parts for fruit_id, row in fruit_rows(connection, part).items()}
    if not dry:
        settle(connection, settlement)
        write_changes(connection, "removed", name, settlement.changes)
    return after, settlement.changes


def _fruits(connection: sqlite3.Connection, fruit_ids: set[int]) -> dict[int, tuple[bytes, str]]:
    """Return place and state of each of these fruits."""
    ids, geoms, states = columns_of(
        connection, "fruits", ("id", "geom", "state"), one_of("fruits.id", sorted(fruit_ids))
    )
    return dict(zip(ids, zip(geoms, states, strict=True), strict=True))


def _place_and_state(row: FruitRow) -> tuple[bytes, str]:
    return row[0], row[1]
