"""Which sessions of a map a winter parts from the last ones of their part."""

from __future__ import annotations

import sqlite3
from datetime import datetime

import numpy as np

from pomona.identity import seasons_of
from pomona.orchard.parts import parts_of_map
from pomona.store.rows import columns_of

__all__ = ["sessions_of_past_seasons"]


def sessions_of_past_seasons(connection: sqlite3.Connection) -> list[int]:
    """Return the sessions of seasons before the last of their part, ascending: what they saw last hangs no more."""
    ids, dates = columns_of(connection, "sessions", ("id", "date"))
    day_of = {one: datetime.fromisoformat(day).toordinal() for one, day in zip(ids, dates, strict=True)}
    past: list[int] = []
    for part in parts_of_map(connection):
        ordered = sorted(part, key=day_of.__getitem__)
        days = np.array([day_of[one] for one in ordered], np.float64)
        past += ordered[: seasons_of(days)[-1].start]
    return sorted(past)
