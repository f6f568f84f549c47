"""A session in the place of the one of its name, inside the transaction that adds it."""

from __future__ import annotations

import sqlite3

import numpy as np

from pomona.orchard.added import Added
from pomona.orchard.session import Session
from pomona.store.rows import columns_of

__all__ = ["NotFoundError", "holds", "there_already"]


class NotFoundError(Exception):
    """Nothing of the transaction is kept: what should take the place of a session was not found in the map."""

    def __init__(self, added: Added) -> None:
        super().__init__()
        self.added = added


def holds(connection: sqlite3.Connection, session: Session) -> bool:
    """Tell whether the map has the very session: by its name, its day and what it saw."""
    there = zip(*columns_of(connection, "sessions", ("name", "date", "content_sha256")), strict=True)
    return (session.name, session.date, session.content_sha256) in there


def there_already(connection: sqlite3.Connection, session: Session) -> Added:
    """Say what the map knows of a session that it holds."""
    rows = connection.execute(
        """SELECT fruit_id, n_sessions FROM observations JOIN fruits ON fruits.id = fruit_id
        WHERE session_id = (SELECT id FROM sessions WHERE name = ?) ORDER BY observations.id""",
        (session.name,),
    ).fetchall()
    ids = np.array([fruit_id for fruit_id, _ in rows], np.int64)
    n_matched = sum(n_sessions > 1 for _, n_sessions in rows)
    return Added(ids, n_matched, len(rows) - n_matched, 0, None, is_added=True, was_there=True)
