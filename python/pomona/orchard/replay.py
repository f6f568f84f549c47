"""The fruits as they follow from what the sessions saw: the rules of adding them one after the other."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.store.rows import columns_of

__all__ = ["ReplayedFruits", "Sighted", "in_view_unseen", "replayed", "sighted"]

NEIGHBOURS = 5
"""A fruit was in view when most of its five nearest fruits were seen: as many as make a constellation."""


@dataclass(frozen=True, eq=False)
class Sighted:
    """What one session saw.

    Attributes
    ----------
    session_id : int
    date : str
    observation_ids, fruit_ids : (K,) int64
    positions_in_map : (K, 3) float64
    diameters_m : (K,) float64
        NaN where unknown.
    """

    session_id: int
    date: str
    observation_ids: NDArray[np.int64]
    fruit_ids: NDArray[np.int64]
    positions_in_map: NDArray[np.float64]
    diameters_m: NDArray[np.float64]


@dataclass(eq=False)
class ReplayedFruits:
    """The table of fruits, (N,) rows in order of id; `first_observation_ids` are those that no match led to."""

    ids: NDArray[np.int64]
    positions: NDArray[np.float64]
    diameters_m: NDArray[np.float64]
    last_seen: NDArray[np.object_]
    last_session_ids: NDArray[np.int64]
    n_sessions: NDArray[np.int64]
    n_missed: NDArray[np.int64]
    is_missed: NDArray[np.bool_]
    first_observation_ids: NDArray[np.int64]

    @classmethod
    def unseen(cls, ids: NDArray[np.int64]) -> ReplayedFruits:
        """Return fruits before the first session."""
        n = len(ids)
        return cls(
            ids=ids,
            positions=np.full((n, 3), np.nan),
            diameters_m=np.full(n, np.nan),
            last_seen=np.full(n, "", dtype=object),
            last_session_ids=np.zeros(n, dtype=np.int64),
            n_sessions=np.zeros(n, dtype=np.int64),
            n_missed=np.zeros(n, dtype=np.int64),
            is_missed=np.zeros(n, dtype=bool),
            first_observation_ids=np.zeros(n, dtype=np.int64),
        )


def sighted(connection: sqlite3.Connection) -> list[Sighted]:
    """Read what each session saw, in the order in which they were added."""
    session_ids, dates = columns_of(connection, "sessions", ("id", "date"))
    names = ("session_id", "id", "fruit_id", "geom", "diameter_m")
    seen_by, ids, fruit_ids, geoms, diameters_m = columns_of(connection, "observations", names)
    numbers, fruits, by = (np.array(column, dtype=np.int64) for column in (ids, fruit_ids, seen_by))
    positions, sizes = geopackage.points_of(geoms), np.array(diameters_m, dtype=np.float64)
    rows = {session_id: np.flatnonzero(by == session_id) for session_id in session_ids}
    return [
        Sighted(session_id, date, numbers[mine], fruits[mine], positions[mine], sizes[mine])
        for (session_id, mine), date in zip(rows.items(), dates, strict=True)
    ]


def replayed(visits: Sequence[Sighted]) -> ReplayedFruits:
    """Return the fruits of a map with these sessions, added in this order."""
    fruits = ReplayedFruits.unseen(
        np.unique(np.concatenate([np.empty(0, np.int64), *(visit.fruit_ids for visit in visits)]))
    )
    newest = ""
    for visit in visits:
        _see(fruits, visit, is_newest=visit.date >= newest)
        newest = max(newest, visit.date)
    return fruits


def _see(fruits: ReplayedFruits, visit: Sighted, *, is_newest: bool) -> None:
    rows = np.searchsorted(fruits.ids, visit.fruit_ids)
    known = np.flatnonzero(fruits.n_sessions)
    missed = known[in_view_unseen(fruits.positions[known], np.isin(known, rows))]
    fruits.n_missed[missed] += 1
    fruits.is_missed[missed] |= is_newest
    is_new = fruits.n_sessions[rows] == 0
    fruits.first_observation_ids[rows[is_new]] = visit.observation_ids[is_new]
    fruits.n_sessions[rows] += 1

    # A visit that is added late moves nothing that a later one has seen.
    moves = fruits.last_seen[rows] <= visit.date
    rows, sizes = rows[moves], visit.diameters_m[moves]
    fruits.positions[rows] = visit.positions_in_map[moves]
    fruits.diameters_m[rows] = np.where(np.isnan(sizes), fruits.diameters_m[rows], sizes)
    fruits.last_seen[rows] = visit.date
    fruits.last_session_ids[rows] = visit.session_id
    fruits.is_missed[rows] = False


def in_view_unseen(positions: NDArray[np.float64], seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the rows of known fruits, (N, 3), that were in view, by their neighbours, and were not seen, (N,)."""
    from scipy.spatial import cKDTree

    neighbours = min(NEIGHBOURS, len(positions) - 1)
    unseen = np.flatnonzero(~seen)
    if neighbours < 1 or not len(unseen):
        return unseen[:0]
    _, nearest = cKDTree(positions).query(positions[unseen], k=list(range(2, neighbours + 2)))
    in_view: NDArray[np.bool_] = 2 * seen[nearest].sum(axis=1) > neighbours
    return unseen[in_view]
