"""Files of formats 1 and 2 brought up to date: nothing is lost, and the user's own columns and indexes stay."""

from __future__ import annotations

import itertools
import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.store.cells import finite_json
from pomona.store.failures import WrongContentError
from pomona.store.layer_styles import add_styles
from pomona.store.older_layers import INDEXES_OF_VERSION_2, layers_of
from pomona.store.rows import columns_of
from pomona.store.schema import FORMAT_VERSION, INDEXES, LAYERS, VIEWS

__all__ = ["migrate", "migrated_copy"]

ANEW = "pomona_anew"
"""A table on its way, of which nothing is seen outside the transaction."""

NEW_INDEXES = {
    statement.split()[2]: statement
    for statement in INDEXES.strip().splitlines()
    if statement not in INDEXES_OF_VERSION_2
}

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
    """Make an older file one of this format, inside the open transaction; foreign keys are off.

    Raises
    ------
    WrongContentError
        When somebody's own table has the name of one that is needed.
    """
    (version,) = connection.execute("SELECT format_version FROM pomona_format").fetchone()
    older = {name: columns for name, _, columns, _ in layers_of(version)}
    _require_free(connection, [name for name, *_ in (*LAYERS, *VIEWS) if name not in older])
    _require_free(connection, NEW_INDEXES)
    for name, geometry, columns, description in LAYERS:
        if name not in older:
            geopackage.add_table(connection, name, columns, description, geometry)
        elif older[name] != columns:
            _lay_out_anew(connection, name, geometry, columns)
            connection.execute("UPDATE gpkg_contents SET description = ? WHERE table_name = ?", (description, name))
    for name, geometry, query, description in VIEWS:
        geopackage.add_view(connection, name, query, description, geometry)
    for statement in NEW_INDEXES.values():
        connection.execute(statement)
    add_styles(connection)
    if "matches" not in older:
        _tell_matches(connection)
    connection.execute("UPDATE pomona_format SET format_version = ?", (FORMAT_VERSION,))


def _require_free(connection: sqlite3.Connection, names: Iterable[str]) -> None:
    theirs = {name.lower() for (name,) in connection.execute("SELECT name FROM sqlite_master")}
    for name in names:
        if name in theirs:
            raise WrongContentError(
                f"has a table or an index {name} that is not Pomona's, and format {FORMAT_VERSION} needs the name: "
                "rename it"
            )


def _lay_out_anew(connection: sqlite3.Connection, name: str, geometry: str, columns: str) -> None:
    """Replace a table: SQLite cannot change the check of a column, nor put one before those that people added.

    A column of theirs that is called as a new one of ours becomes ours.
    """
    connection.execute(f"CREATE TABLE {ANEW} (id INTEGER PRIMARY KEY AUTOINCREMENT, {_with_place(geometry, columns)})")
    ours = {column for column, _ in _columns(connection, ANEW)}
    for column, kind in _columns(connection, name):
        if column.lower() not in ours:
            connection.execute(f'ALTER TABLE {ANEW} ADD COLUMN "{column}" {kind}')
    indexes = connection.execute("SELECT sql FROM sqlite_master WHERE type = 'index' AND tbl_name = ?", (name,))
    indexes_again = [sql for (sql,) in indexes if sql is not None]
    given_out = connection.execute("SELECT seq FROM sqlite_sequence WHERE name = ?", (name,)).fetchall()
    kept = ", ".join(f'"{column}"' for column, _ in _columns(connection, name))
    connection.execute(f"INSERT INTO {ANEW} ({kept}) SELECT {kept} FROM {name}")
    connection.execute(f"DROP TABLE {name}")
    connection.execute(f"ALTER TABLE {ANEW} RENAME TO {name}")
    if geometry:
        geopackage.add_index_triggers(connection, name)
    for sql in indexes_again:
        connection.execute(sql)
    # An id is never given out again, even that of a row that is no longer there.
    connection.execute("DELETE FROM sqlite_sequence WHERE name = ?", (name,))
    connection.executemany(f"INSERT INTO sqlite_sequence (name, seq) VALUES ('{name}', ?)", given_out)


def _with_place(geometry: str, columns: str) -> str:
    return f"geom {geometry}, {columns}" if geometry else columns


def _columns(connection: sqlite3.Connection, table: str) -> list[tuple[str, str]]:
    """Return name and type of each column."""
    return [(name, kind) for _, name, kind, *_ in connection.execute(f"PRAGMA table_info({table})")]


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
