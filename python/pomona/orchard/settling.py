"""What follows for the parts of the map that changed, written into it: only what is another than before."""

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
from pomona.orchard.moving import JOINED_M, move_session, move_trees
from pomona.orchard.writing import nullable
from pomona.store.numbering import last_ids
from pomona.store.rows import columns_of, one_of

__all__ = ["FruitRow", "SettledPart", "Settlement", "fruit_rows", "settle", "settlement_of", "write_changes"]

FruitRow = tuple[bytes, str, str, int, int, int, float | None, float, float]
"""Of a fruit: geom, state, last_seen, last_session_id, n_sessions, n_missed, diameter_m, state_probability,
fruit_probability."""

UNMOVED_M = 1e-9
"""By less than this nothing moves, and no length is another: rounding."""

DIGITS = 4
"""Of probabilities as they are written. One visit more makes all others a little surer: rows that nobody could tell
from what they were stay as they are."""

SUREST = 1.0 - 10.0**-DIGITS
"""That two sights are one fruit, as it is written."""


@dataclass(frozen=True, eq=False)
class SettledPart:
    """Identities of one part of the map as they shall be.

    Attributes
    ----------
    evidence : Evidence
    conclusion : Conclusion
    ids : (K,) int64
        Of the conclusion's fruits.
    """

    evidence: Evidence
    conclusion: Conclusion
    ids: NDArray[np.int64]

    @property
    def fruit_ids(self) -> NDArray[np.int64]:
        """Of the part's sights, (S,)."""
        return self.ids[self.conclusion.labels]

    def fruit_ids_of(self, visit: int) -> NDArray[np.int64]:
        """Return those of the sights of a visit, by its number."""
        return np.asarray(self.fruit_ids[self.conclusion.sights.visits == visit])


@dataclass(frozen=True, eq=False)
class Settlement:
    """Identities of the parts that something came to or went from.

    Attributes
    ----------
    parts : list of SettledPart
    before : set of int
        Ids that their sights had.
    changes : list of Change
    """

    parts: list[SettledPart]
    before: set[int]
    changes: list[Change]

    @property
    def after(self) -> set[int]:
        """Ids that their sights have now."""
        return {fruit_id for part in self.parts for fruit_id in part.ids.tolist()}

    def part_with(self, session_id: int) -> tuple[SettledPart, int]:
        """Return the part of a session, and its number there."""
        part = next(one for one in self.parts if any(v.session_id == session_id for v in one.evidence.visits))
        return part, part.evidence.number_of(session_id)


def settlement_of(connection: sqlite3.Connection, evidence: Evidence) -> Settlement:
    """Say which fruit has which id; an id is one's over all parts, which may have been one before."""
    parts = evidence.parts()
    conclusions = [part.conclusion() for part in parts]
    last_id = last_ids(connection).get("fruits", 0)
    ends = np.cumsum([0, *(len(conclusion.states) for conclusion in conclusions)])
    labels = np.concatenate([one.labels + start for one, start in zip(conclusions, ends[:-1], strict=True)])
    before = np.concatenate([part.fruit_ids for part in parts])
    ids = ids_of_clusters(labels, before, last_id)
    of_parts = zip(parts, conclusions, np.split(ids, ends[1:-1]), strict=True)
    return Settlement(
        [SettledPart(*part) for part in of_parts],
        set(before.tolist()) - {0},
        changes_between(before, ids[labels], last_id),
    )


def settle(connection: sqlite3.Connection, settlement: Settlement) -> None:
    """Bring sessions, fruits and observations of the parts up to date; all of them are in the map already.

    Sessions move first, with their trees, then come new fruits, then observations change theirs, then fruits without
    any go.
    """
    moves: dict[int, NDArray[np.float64]] = {}
    for part in settlement.parts:
        moves |= _move_sessions(connection, part)
    move_trees(connection, moves)
    rows = {fruit_id: row for part in settlement.parts for fruit_id, row in fruit_rows(connection, part).items()}
    _write_fruits(connection, rows, settlement.before)
    for part in settlement.parts:
        _write_observations(connection, part)
    gone = sorted(settlement.before - rows.keys())
    connection.executemany("DELETE FROM fruits WHERE id = ?", ((fruit_id,) for fruit_id in gone))


def _move_sessions(connection: sqlite3.Connection, part: SettledPart) -> dict[int, NDArray[np.float64]]:
    """Move the sessions that lie elsewhere now; return how those moved that came to another part."""
    moves = {}
    for visit, frame in zip(part.evidence.visits, part.conclusion.frames, strict=True):
        if np.abs(frame - visit.map_from_session).max() > UNMOVED_M:
            before, now = (visit.cloud.transformed(one) for one in (visit.map_from_session, frame))
            move_session(connection, visit.session_id, frame, now, visit.observation_ids)
            if np.linalg.norm(now.positions - before.positions, axis=1).max(initial=0.0) > JOINED_M:
                moves[visit.session_id] = frame @ np.linalg.inv(visit.map_from_session)
    return moves


def fruit_rows(connection: sqlite3.Connection, part: SettledPart) -> dict[int, FruitRow]:
    """Return the rows of the part's fruits by id, each where its last sight is."""
    evidence, conclusion = part.evidence, part.conclusion
    order = np.arange(len(evidence.visits))
    looks = conclusion.looks
    first = looks.seen.argmax(axis=1)[:, None]
    n_missed = (looks.in_view & ~looks.seen & (order > first)).sum(axis=1).tolist()
    n_sessions = looks.seen.sum(axis=1).tolist()
    last_sight, diameters_m = _last_of_each(evidence, conclusion)
    seen_by = conclusion.sights.visits[last_sight].tolist()
    observed = evidence.observation_ids[last_sight].tolist()
    geoms = dict(zip(*columns_of(connection, "observations", ("id", "geom"), one_of("id", observed)), strict=True))
    state_probabilities = [round(one, DIGITS) for one in conclusion.state_probabilities.tolist()]
    fruit_probabilities = [round(1.0 - one, DIGITS) for one in conclusion.lives.false.tolist()]
    ids = part.ids.tolist()
    rows: dict[int, FruitRow] = {}
    for fruit in np.argsort(part.ids).tolist():
        visit = evidence.visits[seen_by[fruit]]
        rows[ids[fruit]] = (
            geoms[observed[fruit]],
            conclusion.states[fruit],
            visit.date,
            visit.session_id,
            n_sessions[fruit],
            n_missed[fruit],
            diameters_m[fruit],
            state_probabilities[fruit],
            fruit_probabilities[fruit],
        )
    return rows


def _last_of_each(evidence: Evidence, conclusion: Conclusion) -> tuple[NDArray[np.int64], list[float | None]]:
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
    return last, nullable(diameters_m)


def _write_fruits(connection: sqlite3.Connection, rows: dict[int, FruitRow], known: set[int]) -> None:
    """Write fruits that are new or another than before; the place, which an index follows, only where it moved."""
    names = (
        "id", "geom", "state", "last_seen", "last_session_id", "n_sessions", "n_missed", "diameter_m",
        "state_probability", "fruit_probability",
    )  # fmt: skip
    told = columns_of(connection, "fruits", names, one_of("fruits.id", sorted(known)))
    before = {row[0]: row[1:] for row in zip(*told, strict=True)}
    connection.executemany(
        f"INSERT INTO fruits ({', '.join(names)}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        ((fruit_id, *row) for fruit_id, row in rows.items() if fruit_id not in before),
    )
    changed = [(row, fruit_id) for fruit_id, row in rows.items() if _is_another(before.get(fruit_id, row), row)]
    for written, is_elsewhere in ((names[2:], False), (names[1:], True)):
        connection.executemany(
            f"UPDATE fruits SET {', '.join(f'{name} = ?' for name in written)} WHERE id = ?",
            (
                (*row[-len(written) :], fruit_id)
                for row, fruit_id in changed
                if (row[0] != before[fruit_id][0]) == is_elsewhere
            ),
        )


def _is_another(before: FruitRow, row: FruitRow) -> bool:
    """Tell whether a row is another than before by more than the rounding of its diameter."""
    (*told, diameter_m, _, _), (*now, now_m, _, _) = before, row
    if told != now or before[-2:] != row[-2:]:
        return True
    if diameter_m is None or now_m is None:
        return diameter_m is not now_m
    return abs(diameter_m - now_m) > UNMOVED_M


def _write_observations(connection: sqlite3.Connection, part: SettledPart) -> None:
    """Give observations their fruits, and say how sure that is, where it is another than before."""
    evidence, fruit_ids = part.evidence, part.fruit_ids
    probabilities = np.minimum(np.round(part.conclusion.probabilities, DIGITS), SUREST)
    distances_m = part.conclusion.distances_m
    is_elsewhere = fruit_ids != evidence.fruit_ids
    changed = is_elsewhere.copy()
    for now, before, least in (
        (probabilities, evidence.match_probabilities, 0.0),
        (distances_m, evidence.match_distances_m, UNMOVED_M),
    ):
        changed |= np.isnan(now) != np.isnan(before)
        changed |= np.abs(now - before) > least
    ids = evidence.observation_ids
    connection.executemany(
        "UPDATE observations SET match_probability = ?, match_distance_m = ? WHERE id = ?",
        zip(nullable(probabilities[changed]), nullable(distances_m[changed]), ids[changed].tolist(), strict=True),
    )
    # Two that change places would meet on the way: a session sees a fruit once.
    connection.execute("PRAGMA defer_foreign_keys = ON")
    elsewhere = ids[is_elsewhere].tolist()
    connection.executemany("UPDATE observations SET fruit_id = -id WHERE id = ?", ((row,) for row in elsewhere))
    connection.executemany(
        "UPDATE observations SET fruit_id = ? WHERE id = ?",
        zip(fruit_ids[is_elsewhere].tolist(), elsewhere, strict=True),
    )


def write_changes(
    connection: sqlite3.Connection,
    cause: Literal["added", "removed", "merged"],
    session: str,
    changes: Sequence[Change],
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
