"""The numbers that were given out: none is given out a second time, even after its row was deleted."""

from __future__ import annotations

import sqlite3

from pomona.store.failures import WrongContentError
from pomona.store.schema import LAYERS

__all__ = ["last_ids", "misnumbered"]

MOST = 1 << 62
"""Half of what SQLite can count to: nobody came there by counting."""


def last_ids(connection: sqlite3.Connection) -> dict[str, int]:
    """Return the last number that each layer has given out.

    Raises
    ------
    WrongContentError
        When a layer has larger ones, or has counted what cannot be counted.
    """
    for line in misnumbered(connection):
        raise WrongContentError(line)
    return dict(connection.execute("SELECT name, seq FROM sqlite_sequence"))


def misnumbered(connection: sqlite3.Connection) -> list[str]:
    """Return a line for each layer whose count is wrong."""
    lines = []
    for name, *_ in LAYERS:
        (largest,) = connection.execute(f"SELECT coalesce(max(id), 0) FROM {name}").fetchone()
        counts = [seq for (seq,) in connection.execute("SELECT seq FROM sqlite_sequence WHERE name = ?", (name,))]
        count = counts[0] if len(counts) == 1 else 0 if not counts else None
        if not (isinstance(count, int) and largest <= count < MOST):
            found = str(counts)[1:-1][:60] or "nothing"
            lines.append(
                f"sqlite_sequence: {name}: found {found}, expected a number from {largest} that counts its ids"
            )
    return lines
