"""What is left of a ROS 2 bag in SQLite that was cut off or damaged: its rows in order, up to the first lost one."""

from __future__ import annotations

import sqlite3
import warnings
from collections.abc import Collection, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.bags.message_file import Message, Topic
from pomona.recording.bags.unpacked import MOST_CHUNK_BYTES

__all__ = ["SqliteRest", "is_cut_off"]

HEADER_BYTES = 100

ROWS = "SELECT topic_id, timestamp, data FROM messages ORDER BY id"


def is_cut_off(path: Path) -> bool:
    """Whether the header of a database promises more pages than there are (sqlite.org/fileformat, 1.3)."""
    with path.open("rb") as file:
        header = file.read(HEADER_BYTES)
    if not header.startswith(b"SQLite format 3\0") or len(header) < HEADER_BYTES:
        return False
    page = int.from_bytes(header[16:18], "big")
    return int.from_bytes(header[28:32], "big") * (65536 if page == 1 else page) > path.stat().st_size


@dataclass(frozen=True, eq=False)
class SqliteRest:
    """See `MessageFile`."""

    path: Path
    topics: dict[str, Topic]
    _told: list[bool] = field(default_factory=list)

    kind = "ROS 2 bag"

    @classmethod
    def open(cls, path: Path) -> SqliteRest:
        """Read the topics.

        Raises
        ------
        PomonaError
            When not even those are left.
        """
        try:
            with closing(_connected(path)) as database:
                _require_tables(path, database)
                rows = database.execute("SELECT name, type, serialization_format FROM topics").fetchall()
        except sqlite3.Error as error:
            raise PomonaError(f"{path}: not a ROS 2 bag, or one cut off before its first message ({error})") from None
        named = (tuple(map(str, row)) for row in rows)
        return cls(path, {name: Topic(name, kind, encoding) for name, kind, encoding in named})

    @property
    def files(self) -> tuple[Path, ...]:
        """The file itself."""
        return (self.path,)

    def messages(self, topics: Collection[str], start_ns: int | None = None) -> Iterator[Message]:
        """Read in the order in which the recorder wrote; the index by time lies at the end and may be lost."""
        with closing(_connected(self.path)) as database:
            for row in self._rows(database):
                topic, logged_ns, body = self.topics.get(str(row[0])), row[1], row[2]
                if not isinstance(logged_ns, int) or not isinstance(body, bytes):  # SQLite keeps what it is given
                    continue
                if topic is not None and topic.name in topics and (start_ns is None or logged_ns >= start_ns):
                    yield Message(topic, logged_ns, body)

    def _rows(self, database: sqlite3.Connection) -> Iterator[tuple[object, object, object]]:
        """Give topic, time and body of each message, up to the first that is lost."""
        try:
            names = dict(database.execute("SELECT id, name FROM topics"))
            for number, logged_ns, body in database.execute(ROWS):
                yield names.get(number, ""), logged_ns, body
        except sqlite3.DatabaseError as error:
            self._tell(error)

    def _tell(self, error: sqlite3.DatabaseError) -> None:
        """Say it once, not each time the rows are read."""
        if not self._told:
            self._told.append(True)
            message = f"{self.path}: cut off or damaged: what is there is used ({error})"
            warnings.warn(message, PomonaWarning, stacklevel=3)


def _connected(path: Path) -> sqlite3.Connection:
    # A generator may be finished by another thread than the one that began it.
    database = sqlite3.connect(f"file:{quote(str(path.resolve()))}?mode=ro", uri=True, check_same_thread=False)
    # Else SQLite refuses a file that is shorter than its header says.
    database.execute("PRAGMA writable_schema = ON")
    database.execute("PRAGMA trusted_schema = OFF")
    # A column may be computed, and then be of any size.
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_CHUNK_BYTES)
    return database


def _require_tables(path: Path, database: sqlite3.Connection) -> None:
    """Refuse views of these names, which may be without end."""
    kinds = database.execute("SELECT type FROM sqlite_master WHERE name IN ('topics', 'messages')").fetchall()
    if sorted(kinds) != [("table",), ("table",)]:
        raise PomonaError(f"{path}: found no tables topics and messages, expected a ROS 2 bag")
