"""Whether a session is one that the map has: fruits that lie to each other, and measure, as one visit saw them.

Who saves a table again changes its order, its frame, its last digits or a few of its rows; its hash says nothing then.
Two visits never see a row alike: their fruits scatter by centimetres. Fruits are compared with the ones beside them,
which asks for no pose, and holds where either visit is torn apart and was mended.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pomona.identity import VisitPair
from pomona.orchard.evidence import Evidence, KnownVisit
from pomona.store.failures import WrongContentError

__all__ = ["require_no_near_copy"]

Array = NDArray[np.float64]

SAME_M = 1e-3
"""Between what two copies tell of a length: one may be rounded to millimetres."""

BESIDE = 3
"""Fruits next to one to which its distances are compared; most have to be the same, as one of them may be changed."""

LEAST, SHARE = 10, 0.9
"""Matched fruits that say something, and those of them that a copy has as they were."""


def require_no_near_copy(
    connection: sqlite3.Connection, name: str, visit: KnownVisit, evidence: Evidence, matches: Mapping[int, VisitPair]
) -> None:
    """Refuse a visit, called `name`, that saw what one that it matches saw, to the millimetre."""
    for number, pair in sorted(matches.items()):
        other = evidence.visits[number]
        own = int(visit.seen.key > other.seen.key)
        n_same = _n_same(visit, pair.rows[:, own], other, pair.rows[:, 1 - own])
        if n_same > SHARE * max(len(pair.rows), LEAST):
            (there,) = connection.execute("SELECT name FROM sessions WHERE id = ?", (other.session_id,)).fetchone()
            raise WrongContentError(
                f"session {name} is in the map already, as {there}: {n_same} of {len(pair.rows)} fruits lie as they do "
                f"there, to {1e3 * SAME_M:g} mm, expected those of another visit"
            )


def _n_same(visit: KnownVisit, rows: NDArray[np.int64], other: KnownVisit, other_rows: NDArray[np.int64]) -> int:
    """Count the matched fruits that lie to those beside them, and measure, as in the other visit."""
    from scipy.spatial import cKDTree

    if len(rows) < LEAST:
        return 0
    places, others = visit.cloud.positions[rows], other.cloud.positions[other_rows]
    beside = np.asarray(cKDTree(places).query(places, k=BESIDE + 1)[1])[:, 1:]
    differences_m = np.abs(_to(places, beside) - _to(others, beside))
    grown_m = np.abs(visit.seen.diameters_m[rows] - other.seen.diameters_m[other_rows])
    is_same = (np.median(differences_m, axis=1) <= SAME_M) & ~(grown_m > SAME_M)
    return int(is_same.sum())


def _to(places: Array, beside: NDArray[np.int64]) -> Array:
    """Give the distance from each place to those beside it, (N, K)."""
    return np.asarray(np.linalg.norm(places[beside] - places[:, None], axis=2), np.float64)
