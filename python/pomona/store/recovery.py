"""A file that a killed writer left, where it may not be put in order: a copy is, elsewhere.

SQLite undoes an unfinished transaction from the journal beside the file, and to do so must write. On a read-only disk,
or in somebody else's folder, the file and its journal are copied and the copy is put in order.
"""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pomona.errors import PomonaError

__all__ = ["copied", "is_needed"]

SIDE_FILES = ("-journal", "-wal")
"""What SQLite may leave beside a file: pages before the change, or changes that are not in the file yet."""

TRIES = 5

CANNOT_WRITE = ("SQLITE_READONLY_ROLLBACK", "SQLITE_READONLY_RECOVERY", "SQLITE_READONLY_CANTINIT", "SQLITE_CANTOPEN")
"""How SQLite says that the file is no use before something is written."""


def is_needed(error: sqlite3.Error) -> bool:
    """Tell whether a file could not be read because it may not be written."""
    return (getattr(error, "sqlite_errorname", "") or "").startswith(CANNOT_WRITE)


@contextmanager
def copied(path: Path) -> Iterator[Path]:
    """Give a copy of the file with its journal, in a folder that goes with the block.

    Raises
    ------
    PomonaError
        When it is being written to all the time, or cannot be read.
    """
    path = path.resolve()
    files = [path, *(path.with_name(path.name + end) for end in SIDE_FILES)]
    with tempfile.TemporaryDirectory(prefix="pomona-") as folder:
        for _ in range(TRIES):
            before = _states(files)
            _copy(files, Path(folder))
            if _states(files) == before:
                yield Path(folder) / path.name
                return
        raise PomonaError(f"{path}: another program is using it, try again when it is done")


def _copy(files: list[Path], folder: Path) -> None:
    for file in files:
        (folder / file.name).unlink(missing_ok=True)
        try:
            shutil.copyfile(file, folder / file.name)
        except FileNotFoundError:
            continue
        except OSError as error:
            raise PomonaError(f"{file}: cannot be read: {error.strerror}") from None


def _states(files: list[Path]) -> list[tuple[int, int, int] | None]:
    """Return what changes when a file does; a writer that came and went between two copies is seen by it."""
    stats = [file.stat() if file.exists() else None for file in files]
    return [None if stat is None else (stat.st_ino, stat.st_size, stat.st_mtime_ns) for stat in stats]
