"""What is done: a line a step in a small database, written when the step has ended, and never before."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pomona.errors import PomonaError

__all__ = ["Ledger", "Line", "Stamp"]

Stamp = tuple[int, int]
"""Of a file: size in bytes, time of the last change in nanoseconds."""

VERSION = 1
"""Of the tables below; a ledger of another version is begun anew, and its steps with it."""

TABLES = """
CREATE TABLE steps (
    name TEXT PRIMARY KEY, kind TEXT NOT NULL, key TEXT NOT NULL, settings TEXT NOT NULL, outputs TEXT NOT NULL,
    told TEXT NOT NULL, is_incomplete INTEGER NOT NULL, seconds REAL NOT NULL, peak_bytes INTEGER NOT NULL,
    failure TEXT) WITHOUT ROWID;
CREATE TABLE hashes (
    path TEXT PRIMARY KEY, size INTEGER NOT NULL, changed_ns INTEGER NOT NULL, sha256 TEXT NOT NULL) WITHOUT ROWID;
"""

TIMEOUT_S = 30.0

REASONS = {
    sqlite3.SQLITE_FULL: "the disk is full",
    sqlite3.SQLITE_CANTOPEN: "cannot be written: the file or its folder is read-only",
    sqlite3.SQLITE_READONLY: "cannot be written: the file or its folder is read-only",
    sqlite3.SQLITE_READONLY_DIRECTORY: "cannot be written: the file or its folder is read-only",
}
ANEW = "without the file all steps are done anew"


@dataclass(frozen=True)
class Line:
    """What is known of a step.

    Attributes
    ----------
    name, kind : str
        The step's.
    key : str
        All that its result follows from, as a hash; empty from when it begins until it has ended well.
    settings : str
        The flags of the plan, with the files that they name, as a hash.
    outputs : tuple of str
        What it wrote, named from the folder of the plan.
    told : tuple of str
        What a person should know of it.
    is_incomplete : bool
        Whether it found no match for some of what it was given: a result, and no failure.
    seconds, peak_bytes : float, int
        What it took.
    failure : str or None
        Why it failed the last time.
    """

    name: str
    kind: str
    key: str
    settings: str
    outputs: tuple[str, ...] = ()
    told: tuple[str, ...] = ()
    is_incomplete: bool = False
    seconds: float = 0.0
    peak_bytes: int = 0
    failure: str | None = None


class Ledger:
    """The steps that were done for a farm, and what its files held when they were read.

    Parameters
    ----------
    folder : Path
        Where it is kept; made where it does not exist.
    read_only : bool
        Whether it is only looked at: then nothing is made or written, and one that does not exist is empty.

    Raises
    ------
    PomonaError
        It cannot be kept there.
    """

    def __init__(self, folder: Path, *, read_only: bool = False) -> None:
        self.folder = folder
        self.read_only = read_only
        with self._told():
            if read_only:
                self.connection = _copy_in_memory(folder / "ledger.sqlite")
                return
            (folder / "logs").mkdir(parents=True, exist_ok=True)
            self.connection = sqlite3.connect(folder / "ledger.sqlite", timeout=TIMEOUT_S, isolation_level=None)
            # A power cut may take the last lines with it, a killed run takes none; a step done twice is all it costs.
            self.connection.execute("PRAGMA journal_mode = WAL")
            self.connection.execute("PRAGMA synchronous = NORMAL")
            self.connection.execute("BEGIN IMMEDIATE")
            _lay_out(self.connection)
            self.connection.execute("COMMIT")

    def read(self) -> dict[str, Line]:
        """Return what is known of each step."""
        with self._told():
            return {row[0]: _line(row) for row in self.connection.execute("SELECT * FROM steps")}

    def write(self, line: Line) -> None:
        """Note what became of a step."""
        cells = (
            line.name, line.kind, line.key, line.settings, json.dumps(line.outputs), json.dumps(line.told),
            line.is_incomplete, line.seconds, line.peak_bytes, line.failure,
        )  # fmt: skip
        with self._told():
            self.connection.execute(f"INSERT OR REPLACE INTO steps VALUES ({', '.join('?' * len(cells))})", cells)

    def hashes(self) -> dict[str, tuple[Stamp, str]]:
        """Return what files held when they were read, with their stamps then, by their paths."""
        with self._told():
            rows = self.connection.execute("SELECT path, size, changed_ns, sha256 FROM hashes")
            return {path: ((size, changed_ns), digest) for path, size, changed_ns, digest in rows}

    def write_hashes(self, found: dict[str, tuple[Stamp, str]]) -> None:
        """Remember what files hold."""
        rows = [(path, *stamp, digest) for path, (stamp, digest) in found.items()]
        with self._told():
            self.connection.execute("BEGIN")
            self.connection.executemany("INSERT OR REPLACE INTO hashes VALUES (?, ?, ?, ?)", rows)
            self.connection.execute("COMMIT")

    def log(self, step: str) -> Path:
        """Where what a step says is kept; a suffix tells which of its streams."""
        plain = re.sub(r"[^A-Za-z0-9._-]+", "_", step)[:80]
        return self.folder / "logs" / f"{plain}-{hashlib.sha256(step.encode()).hexdigest()[:8]}"

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Let no other run work on the same farm while the block runs; a killed run leaves no lock.

        Raises
        ------
        PomonaError
            Another one does.
        """
        with (self.folder / "lock").open("a+") as lock:
            if not _is_locked_now(lock.fileno()):
                raise PomonaError(f"{self.folder.parent}: another run is working on this farm, expected one at a time")
            yield

    def is_running(self) -> bool:
        """Tell whether a run is working on the farm."""
        try:
            with (self.folder / "lock").open() as lock:
                return not _is_locked_now(lock.fileno())
        except FileNotFoundError:
            return False

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise PomonaError(f"{self.folder}: cannot be written: {error.strerror}") from None
        except sqlite3.Error as error:
            reason = REASONS.get(getattr(error, "sqlite_errorcode", 0), f"{error}; {ANEW}")
            raise PomonaError(f"{self.folder / 'ledger.sqlite'}: {reason}") from None


def _lay_out(connection: sqlite3.Connection) -> None:
    """Make the tables, unless they are those of this version."""
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    if version == VERSION:
        return
    for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall():
        connection.execute(f'DROP TABLE "{name}"')
    for statement in TABLES.strip().split(";\n"):
        connection.execute(statement)
    connection.execute(f"PRAGMA user_version = {VERSION}")


def _copy_in_memory(path: Path) -> sqlite3.Connection:
    """Give what a ledger holds, also on a disk that takes nothing; none is empty."""
    copy = sqlite3.connect(":memory:", isolation_level=None)
    if path.exists():
        # A log beside the file is that of a run, which keeps what a reader needs there; without one nobody writes.
        has_log = path.with_name(f"{path.name}-wal").exists()
        source = sqlite3.connect(f"{path.absolute().as_uri()}?{'mode=ro' if has_log else 'immutable=1'}", uri=True)
        with contextlib.closing(source):
            source.backup(copy)
    _lay_out(copy)
    return copy


def _line(row: tuple[object, ...]) -> Line:
    name, kind, key, settings, outputs, told, is_incomplete, seconds, peak_bytes, failure = row
    return Line(
        str(name),
        str(kind),
        str(key),
        str(settings),
        tuple(json.loads(str(outputs))),
        tuple(json.loads(str(told))),
        bool(is_incomplete),
        float(str(seconds)),
        int(str(peak_bytes)),
        None if failure is None else str(failure),
    )


def _is_locked_now(descriptor: int) -> bool:
    """Lock a file until it is closed; tell whether that could be done."""
    try:
        import fcntl
    except ImportError:
        return True  # where nothing can be locked, two runs at once are not told
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
