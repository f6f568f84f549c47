"""Waiting for programs that hold a file, in short steps: SQLite's own waiting can be neither interrupted nor told."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable
from pathlib import Path

__all__ = ["TIMEOUT_S", "Waiting", "patiently", "tell_waits", "teller_of"]

TIMEOUT_S = 60.0
"""How long to wait for another program: the longest match of a large map, a few times over."""

STEP_S = 0.2
"""How long SQLite waits at a time."""

QUIET_S = 1.0
"""What is shorter is not worth a line."""

Waiting = Callable[[], None]
"""Called once when somebody has to wait."""

_tellers: list[Callable[[Path], None]] = []
"""Who is told of waits that no caller asked about; a wait may be in any thread."""


def tell_waits(teller: Callable[[Path], None]) -> None:
    """Let the program be told of each file that it has to wait for, once a wait."""
    _tellers[:] = [teller]


def teller_of(path: Path) -> Waiting:
    """Give what tells the program of a wait for this file."""

    def tell() -> None:
        for teller in _tellers:
            teller(path)

    return tell


def patiently(
    connection: sqlite3.Connection, statement: str, timeout_s: float, waiting: Waiting | None
) -> sqlite3.Cursor:
    """Run a statement that waits for other programs up to `timeout_s`; `waiting` is called where it takes a while.

    Raises
    ------
    sqlite3.OperationalError
        When they are still not done, or for another reason.
    """
    begun = time.monotonic()
    connection.execute(f"PRAGMA busy_timeout = {int(1000 * min(timeout_s, STEP_S))}")
    while True:
        try:
            cursor = connection.execute(statement)
            break
        except sqlite3.OperationalError as error:
            waited_s = time.monotonic() - begun
            if error.sqlite_errorname != "SQLITE_BUSY" or waited_s > timeout_s:
                raise
        if waiting is not None and waited_s > QUIET_S:
            waiting()
            waiting = None
    connection.execute(f"PRAGMA busy_timeout = {int(1000 * timeout_s)}")
    return cursor
