"""A session out of the map again: as if it had never been added, but for the ids, which nobody else gets."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.orchard.replay import ReplayedFruits, replayed, sighted
from pomona.orchard.writing import nullable, update_layers
from pomona.store.failures import WrongContentError
from pomona.store.opening import TIMEOUT_S, Waiting, writing
from pomona.store.rows import columns_of

__all__ = ["Removed", "remove_session"]

PARTS = (
    "DELETE FROM sightings WHERE observation_id IN (SELECT id FROM observations WHERE session_id = ?)",
    "DELETE FROM observations WHERE session_id = ?",
    "DELETE FROM poses WHERE session_id = ?",
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
        Fruits that are now where another session saw them, or are no longer missed.
    n_left : int
        Sessions that are left.
    """

    n_observations: int
    n_gone: int
    n_changed: int
    n_left: int


def remove_session(
    path: str | Path, name: str, *, timeout_s: float = TIMEOUT_S, waiting: Waiting | None = None, dry: bool = False
) -> Removed | None:
    """Undo `add_session`: the session, its observations, sightings and poses go, in one transaction.

    Fruits that only it saw go too, and their ids are never given out again. The others fall back to where the last of
    the remaining sessions saw them; hits and misses are counted anew. The frame of the map stays, whoever goes.

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
        return _remove(connection, ids[names.index(name)], dry=dry)


def _remove(connection: sqlite3.Connection, session_id: int, *, dry: bool) -> Removed:
    visits = sighted(connection)
    before = replayed(visits)
    after = replayed([visit for visit in visits if visit.session_id != session_id])
    going = next(visit for visit in visits if visit.session_id == session_id)
    kept = np.isin(before.ids, after.ids)
    changed = _changed(before, after, kept)
    if not dry:
        for part in PARTS:
            connection.execute(part, (session_id,))
        connection.executemany("DELETE FROM fruits WHERE id = ?", ((i,) for i in before.ids[~kept].tolist()))
        _write_fruits(connection, after)
        _forget_matches(connection, after)
        connection.execute("DELETE FROM sessions WHERE id = ?", (session_id,))
        update_layers(connection)
    return Removed(len(going.fruit_ids), int((~kept).sum()), int(changed.sum()), len(visits) - 1)


def _changed(before: ReplayedFruits, after: ReplayedFruits, kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which of the remaining fruits are elsewhere or no longer missed, (N,)."""
    moved = (before.positions[kept] != after.positions).any(axis=1)
    changed: NDArray[np.bool_] = moved | (before.is_missed[kept] != after.is_missed)
    return changed


def _write_fruits(connection: sqlite3.Connection, fruits: ReplayedFruits) -> None:
    connection.executemany(
        """UPDATE fruits SET geom = ?, state = ?, last_seen = ?, last_session_id = ?, n_sessions = ?, n_missed = ?,
        diameter_m = ? WHERE id = ?""",
        zip(
            geopackage.points(fruits.positions),
            np.where(fruits.is_missed, "missed", "seen").tolist(),
            fruits.last_seen.tolist(),
            fruits.last_session_ids.tolist(),
            fruits.n_sessions.tolist(),
            fruits.n_missed.tolist(),
            nullable(fruits.diameters_m),
            fruits.ids.tolist(),
            strict=True,
        ),
    )


def _forget_matches(connection: sqlite3.Connection, fruits: ReplayedFruits) -> None:
    """Make the sessions that are now the first to have seen a fruit say so: their matches were with what is gone."""
    connection.executemany(
        """UPDATE observations SET match_probability = NULL, match_distance_m = NULL
        WHERE id = ? AND match_probability IS NOT NULL""",
        ((i,) for i in fruits.first_observation_ids.tolist()),
    )
