"""Files of format 1 brought up to date: nothing is lost, and the user's own columns and indexes stay."""

from __future__ import annotations

import itertools
import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.store.cells import finite_json
from pomona.store.rows import columns_of
from pomona.store.schema import FORMAT_VERSION, LAYERS, SINCE_VERSION_2

__all__ = ["migrate", "migrated_copy"]

KEPT = "id, geom, state, last_seen, last_session_id, n_sessions, n_missed, diameter_m, tree_id"
"""Columns of `fruits` in format 1; what is not among them is the user's."""

COMMON = """
SELECT one.id, other.id, min(coalesce(one.match_probability, 1.0), coalesce(other.match_probability, 1.0))
FROM observations one JOIN observations other ON other.fruit_id = one.fruit_id
WHERE one.session_id = ? AND other.session_id = ? ORDER BY one.id
"""
"""The fruits that two sessions saw, as format 1 knew them: one of the two was matched, or both with a third."""


@contextmanager
def migrated_copy(connection: sqlite3.Connection) -> Iterator[sqlite3.Connection]:
    """Give a copy in memory that is up to date: who reads a file leaves it as it is."""
    copy = sqlite3.connect(":memory:", isolation_level=None)
    try:
        connection.backup(copy)
        copy.text_factory = connection.text_factory
        geopackage.add_functions(copy)
        copy.execute("PRAGMA foreign_keys = OFF")
        copy.execute("BEGIN")
        migrate(copy)
        copy.execute("COMMIT")
        yield copy
    finally:
        copy.close()


def migrate(connection: sqlite3.Connection) -> None:
    """Make a file of format 1 one of this, inside the open transaction; foreign keys are off."""
    layers = {name: layer for name, *layer in LAYERS}
    for name in SINCE_VERSION_2:
        geometry, columns, description = layers[name]
        geopackage.add_table(connection, name, columns, description, geometry)
    _lay_fruits_out_anew(connection, layers["fruits"][1])
    _tell_matches(connection)
    connection.execute("UPDATE pomona_format SET format_version = ?", (FORMAT_VERSION,))


def _lay_fruits_out_anew(connection: sqlite3.Connection, columns: str) -> None:
    """Replace the table, whose states were fewer: SQLite cannot change the check of a column."""
    own = [
        (f'"{name}"', kind)
        for _, name, kind, *_ in connection.execute("PRAGMA table_info(fruits)")
        if name not in KEPT.split(", ")
    ]
    indexes = connection.execute(
        "SELECT sql FROM sqlite_master WHERE type = 'index' AND tbl_name = 'fruits'"
    ).fetchall()
    given_out = connection.execute("SELECT seq FROM sqlite_sequence WHERE name = 'fruits'").fetchall()
    added = "".join(f", {name} {kind}" for name, kind in own)
    kept = ", ".join([KEPT, *(name for name, _ in own)])
    connection.execute(f"CREATE TABLE fruits_anew (id INTEGER PRIMARY KEY AUTOINCREMENT, geom POINT, {columns}{added})")
    connection.execute(f"INSERT INTO fruits_anew ({kept}) SELECT {kept} FROM fruits")
    connection.execute("DROP TABLE fruits")
    connection.execute("ALTER TABLE fruits_anew RENAME TO fruits")
    geopackage.add_index_triggers(connection, "fruits")
    for (sql,) in indexes:
        if sql is not None:
            connection.execute(sql)
    # An id is never given out again, even that of a fruit that is no longer there.
    connection.execute("DELETE FROM sqlite_sequence WHERE name = 'fruits'")
    connection.executemany("INSERT INTO sqlite_sequence (name, seq) VALUES ('fruits', ?)", given_out)


def _tell_matches(connection: sqlite3.Connection) -> None:
    """Write down how every two sessions match, by the identities of format 1."""
    columns_of(connection, "observations", ("match_probability",))
    names = ("id", "date", "content_sha256", "map_from_session", "log_odds")
    sessions = sorted(
        zip(*columns_of(connection, "sessions", names), strict=True), key=lambda session: (session[1], session[2])
    )
    for one, other in itertools.combinations(sessions, 2):
        pairs = [list(pair) for pair in connection.execute(COMMON, (one[0], other[0]))]
        if pairs:
            log_odds = min(known for known in (one[4], other[4], np.inf) if known is not None)
            connection.execute(
                """INSERT INTO matches (first_session_id, second_session_id, first_from_second, log_odds, pairs)
                VALUES (?, ?, ?, ?, ?)""",
                (one[0], other[0], _between(one[3], other[3]), float(np.nan_to_num(log_odds)), json.dumps(pairs)),
            )


def _between(map_from_one: str, map_from_other: str) -> str:
    """Return the transform from one session to another as the files hold it."""
    one, other = (_matrix(text) for text in (map_from_one, map_from_other))
    return json.dumps((np.linalg.inv(one) @ other).tolist())


def _matrix(text: str) -> NDArray[np.float64]:
    return np.array(finite_json(text), np.float64)
