"""What a connection to a file of strangers may do.

Three walls, each enough for most attacks: the schema is compared with ours (`shape`), SQLite is told to trust nothing
in the file, and every statement is asked for what it will do before it runs.
"""

from __future__ import annotations

import sqlite3
import sys

from pomona.store import shape

__all__ = ["guard", "release", "trust"]

STEPS_PER_PAGE = 100_000
"""A page of 4096 bytes holds at most 400 rows of ours, and reading a row takes under 100 steps of SQLite's machine."""

LEAST_STEPS = 10_000_000
"""What small files may take anyway; a tenth of a second."""

STEPS_BETWEEN_LOOKS = 10_000

LEAST_LENGTH = 64 << 20
"""No cell can be longer than the file; in a new one, 64 MiB is enough for a configuration."""

MOST_LENGTH = (1 << 31) - 1
"""SQLite counts lengths in 32 bits."""

PRAGMAS = frozenset(
    (
        "application_id",
        "busy_timeout",
        "defer_foreign_keys",
        "foreign_key_check",
        "foreign_keys",
        "integrity_check",
        "page_count",
        "page_size",
        "trusted_schema",
    )
)


def guard(connection: sqlite3.Connection, file_bytes: int) -> None:
    """Trust nothing in the file; bound the work and the memory that it can ask for by its size."""
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(max(file_bytes, LEAST_LENGTH), MOST_LENGTH))
    connection.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
    if sys.version_info >= (3, 12):
        connection.setconfig(sqlite3.SQLITE_DBCONFIG_DEFENSIVE, True)
        connection.setconfig(sqlite3.SQLITE_DBCONFIG_ENABLE_VIEW, False)
    for pragma in ("trusted_schema = OFF", "writable_schema = OFF", "cell_size_check = ON", "foreign_keys = ON"):
        connection.execute(f"PRAGMA {pragma}")
    _bound_steps(connection, file_bytes)
    connection.set_authorizer(_answer)


def release(connection: sqlite3.Connection) -> None:
    """Let a connection make the tables of a file that was empty."""
    connection.set_authorizer(None)
    trust(connection)


def trust(connection: sqlite3.Connection) -> None:
    """Let the schema call our functions, now that it is known to be ours, and work for the rows that come.

    The triggers of the spatial index call ST_MinX and its like, which SQLite forbids to a schema that is not trusted; a
    function cannot be declared innocuous from Python.
    """
    connection.execute("PRAGMA trusted_schema = ON")
    connection.set_progress_handler(None, STEPS_BETWEEN_LOOKS)


def _bound_steps(connection: sqlite3.Connection, file_bytes: int) -> None:
    left = max(LEAST_STEPS, file_bytes // 4096 * STEPS_PER_PAGE)

    def is_enough() -> bool:
        nonlocal left
        left -= STEPS_BETWEEN_LOOKS
        return left < 0

    connection.set_progress_handler(is_enough, STEPS_BETWEEN_LOOKS)


def _answer(action: int, first: str | None, _second: str | None, _database: str | None, asker: str | None) -> int:
    return sqlite3.SQLITE_OK if _may(action, first, asker) else sqlite3.SQLITE_DENY


def _may(action: int, first: str | None, asker: str | None) -> bool:
    """Tell whether a statement may do this; `asker` is the trigger or the view that asks, if any."""
    if asker is not None and ("trigger", asker.lower()) not in shape.expected():
        return False
    if action in (sqlite3.SQLITE_INSERT, sqlite3.SQLITE_UPDATE, sqlite3.SQLITE_DELETE):
        # A spatial index prepares its statements when it is opened, even to be read; SQLite guards its own table.
        name = (first or "").lower()
        return ("table", name) in shape.expected() or name.startswith("rtree_") or name == "sqlite_master"
    if action == sqlite3.SQLITE_PRAGMA:
        return first in PRAGMAS
    return action in (sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ, sqlite3.SQLITE_FUNCTION, sqlite3.SQLITE_TRANSACTION)
