"""What follows from all sessions, written into the map: only what is another than before."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pomona.identity import Conclusion
from pomona.orchard.evidence import Evidence
from pomona.orchard.fruit_ids import Change, changes_between, ids_of_clusters
from pomona.orchard.moving import move_session
from pomona.orchard.writing import nullable
from pomona.store.numbering import last_ids
from pomona.store.rows import columns_of

__all__ = ["FruitRow", "Settlement", "fruit_rows", "settle", "settlement_of", "write_changes"]

FruitRow = tuple[bytes, str, str, int, int, int, float | None, float, float]
"""Of a fruit: geom, state, last_seen, last_session_id, n_sessions, n_missed, diameter_m, state_probability,
fruit_probability."""

UNMOVED_M = 1e-9
"""By less than this nothing moves: rounding."""


@dataclass(frozen=True, eq=False)
class Settlement:
    """Identities as they shall be.

    Attributes
    ----------
    conclusion : Conclusion
    ids : (K,) int64
        Of the conclusion's fruits.
    fruit_ids : (S,) int64
        Of its sights.
    last_id : int
        The last id that had been given out before.
    changes : list of Change
    """

    conclusion: Conclusion
    ids: NDArray[np.int64]
    fruit_ids: NDArray[np.int64]
    last_id: int
    changes: list[Change]


def settlement_of(connection: sqlite3.Connection, evidence: Evidence) -> Settlement:
    """Say which fruit has which id."""
    conclusion = evidence.conclusion()
    last_id = last_ids(connection).get("fruits", 0)
    ids = ids_of_clusters(conclusion.labels, evidence.fruit_ids, last_id)
    fruit_ids = ids[conclusion.labels]
    changes = changes_between(evidence.fruit_ids, fruit_ids, last_id)
    return Settlement(conclusion, ids, fruit_ids, last_id, changes)


def settle(connection: sqlite3.Connection, evidence: Evidence, settlement: Settlement) -> None:
    """Bring sessions, fruits and observations up to date; all of them are in the map already.

    Sessions move first, then come new fruits, then observations change theirs, then fruits without any go.
    """
    frames = settlement.conclusion.frames
    for visit, frame in zip(evidence.visits, frames, strict=True):
        if np.abs(frame - visit.map_from_session).max() > UNMOVED_M:
            move_session(connection, visit.session_id, frame, visit.cloud.transformed(frame), visit.observation_ids)
    rows = fruit_rows(connection, evidence, settlement)
    _write_fruits(connection, rows)
    _write_observations(connection, evidence, settlement)
    connection.execute("DELETE FROM fruits WHERE id NOT IN (SELECT fruit_id FROM observations)")


def fruit_rows(connection: sqlite3.Connection, evidence: Evidence, settlement: Settlement) -> dict[int, FruitRow]:
    """Return the table of fruits by id, each where its last sight is."""
    conclusion = settlement.conclusion
    geoms = dict(zip(*columns_of(connection, "observations", ("id", "geom")), strict=True))
    order = np.arange(len(evidence.visits))
    looks = conclusion.looks
    first = looks.seen.argmax(axis=1)[:, None]
    n_missed = (looks.in_view & ~looks.seen & (order > first)).sum(axis=1).tolist()
    n_sessions = looks.seen.sum(axis=1).tolist()
    last_sight, diameters_m = _last_of_each(evidence, conclusion)
    rows: dict[int, FruitRow] = {}
    for fruit in np.argsort(settlement.ids).tolist():
        sight = last_sight[fruit]
        visit = evidence.visits[int(conclusion.sights.visits[sight])]
        rows[int(settlement.ids[fruit])] = (
            geoms[int(evidence.observation_ids[sight])],
            conclusion.states[fruit],
            visit.date,
            visit.session_id,
            n_sessions[fruit],
            n_missed[fruit],
            diameters_m[fruit],
            float(conclusion.state_probabilities[fruit]),
            float(1.0 - conclusion.lives.false[fruit]),
        )
    return rows


def _last_of_each(evidence: Evidence, conclusion: Conclusion) -> tuple[list[int], list[float | None]]:
    """Return the last sight of each fruit and its last diameter that is known."""
    labels = conclusion.labels
    n_fruits = len(conclusion.states)
    last = np.zeros(n_fruits, np.int64)
    last[labels] = np.arange(len(labels))
    sizes = np.concatenate(
        [
            np.full(len(visit.cloud), np.nan)
            if visit.cloud.diameters_m is None
            else visit.cloud.diameters_m * np.cbrt(np.linalg.det(frame[:3, :3]))
            for visit, frame in zip(evidence.visits, conclusion.frames, strict=True)
        ]
    )
    known = np.flatnonzero(~np.isnan(sizes))
    diameters_m = np.full(n_fruits, np.nan)
    diameters_m[labels[known]] = sizes[known]
    return last.tolist(), nullable(diameters_m)


def _write_fruits(connection: sqlite3.Connection, rows: dict[int, FruitRow]) -> None:
    names = (
        "id", "geom", "state", "last_seen", "last_session_id", "n_sessions", "n_missed", "diameter_m",
        "state_probability", "fruit_probability",
    )  # fmt: skip
    before = {row[0]: row[1:] for row in zip(*columns_of(connection, "fruits", names), strict=True)}
    connection.executemany(
        f"INSERT INTO fruits ({', '.join(names)}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        ((fruit_id, *row) for fruit_id, row in rows.items() if fruit_id not in before),
    )
    connection.executemany(
        f"UPDATE fruits SET {', '.join(f'{name} = ?' for name in names[1:])} WHERE id = ?",
        ((*row, fruit_id) for fruit_id, row in rows.items() if before.get(fruit_id, row) != row),
    )


def _write_observations(connection: sqlite3.Connection, evidence: Evidence, settlement: Settlement) -> None:
    """Give observations their fruits, and say how sure that is."""
    names = ("id", "fruit_id", "match_probability", "match_distance_m")
    before = {row[0]: row[1:] for row in zip(*columns_of(connection, "observations", names), strict=True)}
    after = zip(
        evidence.observation_ids.tolist(),
        settlement.fruit_ids.tolist(),
        nullable(settlement.conclusion.probabilities),
        nullable(settlement.conclusion.distances_m),
        strict=True,
    )
    changed = [row for row in after if before[row[0]] != row[1:]]
    # Two that change places would meet on the way: a session sees a fruit once.
    connection.execute("PRAGMA defer_foreign_keys = ON")
    elsewhere = [(row[0],) for row in changed if before[row[0]][0] != row[1]]
    connection.executemany("UPDATE observations SET fruit_id = -id WHERE id = ?", elsewhere)
    connection.executemany(
        "UPDATE observations SET fruit_id = ?, match_probability = ?, match_distance_m = ? WHERE id = ?",
        ((*row[1:], row[0]) for row in changed),
    )


def write_changes(
    connection: sqlite3.Connection, cause: Literal["added", "removed"], session: str, changes: Sequence[Change]
) -> None:
    """Keep what changed as history."""
    connection.executemany(
        """INSERT INTO changes (cause, session, event, from_fruit_id, to_fruit_id, n_observations)
        VALUES (?, ?, ?, ?, ?, ?)""",
        (
            (cause, session, change.event, change.from_fruit_id, change.to_fruit_id, change.n_observations)
            for change in changes
        ),
    )
