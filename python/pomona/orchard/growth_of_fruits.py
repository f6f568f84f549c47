"""How fast fruits have grown so far, for whoever looks at the layer: a straight line through what visits measured.

`pomona growth` fits a model to all fruits at once; this is what a map can say of a fruit by itself.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Sequence
from datetime import datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from pomona.orchard.fruit_ids import Change
from pomona.orchard.writing import nullable
from pomona.store.rows import columns_of

__all__ = ["write_growth"]

AT_ONCE = 10_000
"""Fruits of one question."""

LEAST_DAYS = 1.0
"""Between the first and the last visit; in less no fruit grows."""


def write_growth(connection: sqlite3.Connection, fruit_ids: Iterable[int], changes: Sequence[Change]) -> None:
    """Write the rate, in mm a day, of fruits of which sights have come or gone; null where one day tells none."""
    touched = {*fruit_ids, *(one for change in changes for one in (change.from_fruit_id, change.to_fruit_id))}
    dates = dict(zip(*columns_of(connection, "sessions", ("id", "date")), strict=True))
    day_of = {session: _day(date) for session, date in dates.items()}
    ids = np.array(sorted(touched), np.int64)
    for start in range(0, len(ids), AT_ONCE):
        part = ids[start : start + AT_ONCE]
        which = f"WHERE diameter_m NOTNULL AND fruit_id IN ({', '.join(map(str, part.tolist()))}) ORDER BY id"
        fruits, sessions, diameters_m = columns_of(
            connection, "observations", ("fruit_id", "session_id", "diameter_m"), which
        )
        rates = _rates(part, fruits, [day_of[session] for session in sessions], diameters_m)
        connection.executemany(
            "UPDATE fruits SET growth_mm_per_day = ?1 WHERE id = ?2 AND growth_mm_per_day IS NOT ?1",
            zip(nullable(rates), part.tolist(), strict=True),
        )


def _day(date: str) -> float:
    return (datetime.fromisoformat(date) - datetime(2000, 1, 1)) / timedelta(days=1)


def _rates(
    ids: NDArray[np.int64], fruits: Sequence[int], days: Sequence[float], diameters_m: Sequence[float]
) -> NDArray[np.float64]:
    """Return the slope of the straight line through the sizes of each fruit, (N,); NaN where there is none."""
    row = np.searchsorted(ids, np.array(fruits, np.int64))
    x, y = np.array(days, np.float64), 1000.0 * np.array(diameters_m, np.float64)
    n = np.bincount(row, minlength=len(ids))
    least = np.full(len(ids), np.inf)
    np.minimum.at(least, row, x)
    most = np.full(len(ids), -np.inf)
    np.maximum.at(most, row, x)
    means = [np.bincount(row, values, len(ids)) / np.maximum(n, 1) for values in (x, y)]
    off_x, off_y = x - means[0][row], y - means[1][row]
    squares = np.bincount(row, off_x**2, len(ids))
    slopes = np.bincount(row, off_x * off_y, len(ids)) / np.where(squares > 0, squares, 1.0)
    return np.where(most - least >= LEAST_DAYS, np.round(slopes, 6), np.nan)
