"""ROS 1 bags, and ROS 2 bags in SQLite, through rosbags."""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pomona.errors import PomonaError
from pomona.recording.bags.message_file import Message, Topic
from pomona.recording.bags.quality_of_service import LATCHED, QOS, profiles_text
from pomona.recording.bags.unpacked import MOST_CHUNK_BYTES, unpacked

__all__ = ["DamagedBagError", "RosBag"]


class DamagedBagError(PomonaError):
    """A bag cannot be read to its end."""


@dataclass(frozen=True, eq=False)
class RosBag:
    """See `MessageFile`."""

    path: Path
    kind: str
    topics: dict[str, Topic]
    files: tuple[Path, ...]

    @classmethod
    def open(cls, path: Path, files: tuple[Path, ...]) -> RosBag:
        """Open a .bag, a .db3 or the folder of a ROS 2 bag.

        Raises
        ------
        DamagedBagError
            When it cannot be read.
        """
        with _opened(path) as reader:
            topics = {each.topic: _topic_of(path, each) for each in reader.connections}
        return cls(path, "ROS 1 bag" if path.suffix == ".bag" else "ROS 2 bag", topics, files)

    def messages(self, topics: Collection[str], start_ns: int | None = None) -> Iterator[Message]:
        """Read in order of the time of logging.

        Raises
        ------
        DamagedBagError
            Where it cannot be read any further.
        """
        with _opened(self.path) as reader:
            connections = [each for each in reader.connections if each.topic in topics]
            if not connections:
                return
            messages = reader.messages(connections, start=start_ns)
            while True:
                try:
                    connection, logged_ns, body = next(messages)
                except StopIteration:
                    return
                except Exception as error:
                    raise DamagedBagError(f"{self.path}: damaged ({_first_line(error)})") from None
                if not isinstance(logged_ns, int) or not isinstance(body, bytes):  # SQLite keeps what it is given
                    raise DamagedBagError(f"{self.path}: damaged (a message is {type(body).__name__})")
                yield Message(self.topics[connection.topic], logged_ns, body)


def _topic_of(path: Path, connection: Any) -> Topic:
    from rosbags.interfaces import MessageDefinitionFormat

    about, definition = connection.ext, connection.msgdef
    ros1 = not hasattr(about, "offered_qos_profiles")
    if ros1:
        metadata = {QOS: LATCHED} if about.latching else {}
    else:
        metadata = {QOS: profiles_text(about.offered_qos_profiles)} if about.offered_qos_profiles else {}
    languages = {MessageDefinitionFormat.NONE: "", MessageDefinitionFormat.IDL: "ros2idl"}
    language = languages.get(definition.format, "ros1msg" if ros1 else "ros2msg")
    for text in (connection.topic, connection.msgtype, definition.data):
        if not isinstance(text, str):  # SQLite keeps what it is given
            raise DamagedBagError(f"{path}: damaged (a topic, its type or definition is {type(text).__name__})")
    encoding = "ros1" if ros1 else "cdr"
    return Topic(connection.topic, connection.msgtype, encoding, language, definition.data.encode(), metadata)


def _opened(path: Path) -> Any:
    from rosbags import rosbag1, rosbag2

    reader: Any = (rosbag1 if path.suffix == ".bag" else rosbag2).Reader(path)
    return _Opened(path, reader)


class _Opened:
    """A reader that says in one line what is wrong with its file."""

    def __init__(self, path: Path, reader: Any) -> None:
        self.path, self.reader = path, reader

    def __enter__(self) -> Any:
        try:
            reader = self.reader.__enter__()
            _bound(reader)
            return reader
        except Exception as error:  # its own errors, SQLite's, and those of what a damaged header makes it do
            raise DamagedBagError(f"{self.path}: not a bag, or a damaged one ({_first_line(error)})") from None

    def __exit__(self, *_: object) -> None:
        self.reader.close()


def _bound(reader: Any) -> None:
    """Bound what rosbags takes memory for: chunks of ROS 1, and values that SQLite may compute as it reads them."""
    if hasattr(reader, "chunks"):
        reader.chunks = {place: _bounded(chunk) for place, chunk in reader.chunks.items()}
        return
    import apsw

    for storage in getattr(reader.storage, "storages", [reader.storage]):
        storage.dbconn.limit(apsw.SQLITE_LIMIT_LENGTH, MOST_CHUNK_BYTES)


def _bounded(chunk: Any) -> Any:
    """Give a chunk of rosbags the decompressor of `unpacked`."""
    from rosbags.rosbag1.reader import decompressors

    name = next(name for name, decompressor in decompressors.items() if decompressor is chunk.decompressor)
    return chunk._replace(decompressor=functools.partial(unpacked, name))


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
