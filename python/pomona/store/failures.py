"""What goes wrong with a file, in one line that names it."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pomona.errors import PomonaError

__all__ = ["DAMAGED", "WrongContentError", "content", "told"]

MOST_PATH = 504
"""Bytes of a path with which SQLite opens a file: 512 with the name of its journal."""

DAMAGED = "is damaged; restore it from a copy"

REASONS = {
    "SQLITE_BUSY": "another program is using it, try again when it is done",
    "SQLITE_LOCKED": "another program is using it, try again when it is done",
    "SQLITE_PROTOCOL": "another program is using it, try again when it is done",
    "SQLITE_FULL": "the disk is full; the file is as it was before",
    "SQLITE_IOERR": "the disk does not take or give what it should ({name}); the file is as it was before",
    "SQLITE_READONLY": "cannot be written: the file or its folder is read-only",
    "SQLITE_CANTOPEN": "cannot be opened: is it there, and may it be read?",
    "SQLITE_PERM": "cannot be opened: is it there, and may it be read?",
    "SQLITE_NOTADB": "is not a GeoPackage",
    "SQLITE_CORRUPT": DAMAGED,
    "SQLITE_FORMAT": DAMAGED,
    "SQLITE_CONSTRAINT": "its rows contradict each other ({error}); `pomona map check` says where",
    "SQLITE_MISMATCH": "its rows contradict each other ({error}); `pomona map check` says where",
    "SQLITE_INTERRUPT": "asks for more work than its size explains: it is damaged, or was made to",
    "SQLITE_TOOBIG": "holds a longer text than its size explains: it is damaged, or was made to",
    "SQLITE_AUTH": "asks for what no map needs ({error}): it was made to",
}
"""What to tell people of the errors of SQLite, by the beginning of their names; any other is a bug of ours."""


class WrongContentError(PomonaError):
    """What a file says cannot be; `told` puts the name of the file in front."""


@contextmanager
def told(path: Path) -> Iterator[None]:
    """Turn the errors of SQLite, and wrong content, into one line that names the file and the reason."""
    try:
        yield
    except WrongContentError as error:
        raise PomonaError(f"{path}: {error}") from None
    except UnicodeDecodeError:
        # sqlite3 cannot tell an error of SQLite that quotes a damaged schema.
        raise PomonaError(f"{path}: {DAMAGED}") from None
    except sqlite3.Error as error:
        name = getattr(error, "sqlite_errorname", "") or ""
        reason = next((text for code, text in REASONS.items() if name.startswith(code)), None)
        if name.startswith("SQLITE_CANTOPEN") and (length := len(os.fsencode(path.resolve()))) > MOST_PATH:
            reason = f"cannot be opened: its whole path has {length} bytes, expected at most {MOST_PATH} of a database"
        if reason is None:
            raise
        raise PomonaError(f"{path}: {reason.format(name=name, error=error)}") from None


@contextmanager
def content(what: str) -> Iterator[None]:
    """Tell the refusal of what was made of a file's rows as that of the rows."""
    try:
        yield
    except WrongContentError:
        raise
    except PomonaError as error:
        raise WrongContentError(f"{what}: {error}") from None
