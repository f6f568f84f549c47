"""What is left of a ROS 1 bag whose recorder was killed, or that was cut off or damaged.

Records are walked from the beginning (http://wiki.ros.org/Bags/Format/2.0): u32 length of the header, header,
u32 length of the content, content; a header is fields of u32 length and `name=value`.
"""

from __future__ import annotations

import struct
import warnings
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.bags.message_file import Message, Topic, ros2_name
from pomona.recording.bags.quality_of_service import LATCHED, QOS
from pomona.recording.bags.unpacked import unpacked

__all__ = ["Ros1Rest", "has_no_index"]

MAGIC = b"#ROSBAG V2.0\n"

MESSAGE, CHUNK, CONNECTION = 2, 5, 7
"""Operation codes of the records that matter here."""

Fields = dict[bytes, bytes]


def has_no_index(path: Path) -> bool:
    """Whether the place of the index in the bag's first record is not yet known, or behind the end of the file."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return False
        length = int.from_bytes(file.read(4), "little")
        size = path.stat().st_size
        fields = _fields(file.read(length)) if length < size else {}
    index = int.from_bytes(fields.get(b"index_pos", b"")[:8], "little")
    return index == 0 or index >= size


@dataclass(frozen=True, eq=False)
class Ros1Rest:
    """See `MessageFile`.

    Attributes
    ----------
    chunks : tuple of (int, int, bytes)
        Where the content of each chunk that is whole begins, its length and its compression.
    """

    path: Path
    chunks: tuple[tuple[int, int, bytes], ...]
    topics: dict[str, Topic]
    _connections: dict[int, Topic] = field(default_factory=dict)
    _damaged: set[int] = field(default_factory=set)

    kind = "ROS 1 bag"

    @classmethod
    def open(cls, path: Path) -> Ros1Rest:
        """Find the chunks, and the topics in them.

        Raises
        ------
        PomonaError
            When it is no ROS 1 bag.
        """
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise PomonaError(f"{path}: not a ROS 1 bag of version 2.0, or one without its beginning")
            chunks = tuple(_chunks(file))
        opened = cls(path, chunks, {})
        if has_no_index(path):
            warnings.warn(f"{path}: cut off or not closed: what is there is used", PomonaWarning, stacklevel=5)
        for _ in opened.messages(()):
            pass
        opened.topics.update({topic.name: topic for topic in opened._connections.values()})
        return opened

    @property
    def files(self) -> tuple[Path, ...]:
        """The file itself."""
        return (self.path,)

    def messages(self, topics: Collection[str], start_ns: int | None = None) -> Iterator[Message]:
        """Read in the order of the file."""
        with self.path.open("rb") as file:
            for offset, length, compression in self.chunks:
                file.seek(offset)
                for logged_ns, number, body in self._inside(offset, compression, file.read(length)):
                    topic = self._connections.get(number)
                    if topic is not None and topic.name in topics and (start_ns is None or logged_ns >= start_ns):
                        yield Message(topic, logged_ns, body)

    def _inside(self, offset: int, compression: bytes, content: bytes) -> Iterator[tuple[int, int, bytes]]:
        """Give (time, connection, body) of a chunk's messages; a damaged one has none, and is told once."""
        try:
            plain = unpacked(compression.decode("ascii", "replace"), content)
            connections = dict(_connections(plain))
        except (KeyError, IndexError, ValueError, struct.error) as error:
            if offset not in self._damaged:
                self._damaged.add(offset)
                message = f"{self.path}: the chunk at byte {offset} is damaged and left out ({error})"
                warnings.warn(message, PomonaWarning, stacklevel=3)
            return
        self._connections.update(connections)
        for fields, start, end in _records(plain):
            if fields[b"op"][0] == MESSAGE:
                yield _logged_ns(fields), _number(fields), plain[start:end]


def _chunks(file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
    """Walk over the file without reading the chunks; the last one counts only when it is whole."""
    size = file.seek(0, 2)
    offset = len(MAGIC)
    while offset + 4 <= size:
        file.seek(offset)
        header_length = int.from_bytes(file.read(4), "little")
        if offset + 8 + header_length > size:
            return
        fields = _fields(file.read(header_length))
        length = int.from_bytes(file.read(4), "little")
        offset += 8 + header_length
        if offset + length > size:
            return
        if fields.get(b"op", b"\0")[0] == CHUNK:
            yield offset, length, fields.get(b"compression", b"none")
        offset += length


def _connections(plain: bytes) -> Iterator[tuple[int, Topic]]:
    """Give number and topic of each connection of a chunk, all of whose records are looked at."""
    for fields, start, end in _records(plain):
        operation = fields[b"op"][0]
        if operation in (MESSAGE, CONNECTION):
            number = _number(fields)
            if operation == CONNECTION:
                yield number, _topic(fields, plain[start:end])
            else:
                _logged_ns(fields)


def _number(fields: Fields) -> int:
    return int(struct.unpack("<I", fields[b"conn"])[0])


def _logged_ns(fields: Fields) -> int:
    seconds, nanoseconds = struct.unpack("<II", fields[b"time"])
    return int(seconds) * 10**9 + int(nanoseconds)


def _records(content: bytes) -> Iterator[tuple[Fields, int, int]]:
    """Give the header of each record, and where its content begins and ends."""
    offset = 0
    while offset < len(content):
        (header_length,) = struct.unpack_from("<I", content, offset)
        header = content[offset + 4 : offset + 4 + header_length]
        (length,) = struct.unpack_from("<I", content, offset + 4 + header_length)
        start = offset + 8 + header_length
        if start + length > len(content):
            raise ValueError("a record is longer than its chunk")
        yield _fields(header), start, start + length
        offset = start + length


def _fields(header: bytes) -> Fields:
    fields: Fields = {}
    offset = 0
    while offset + 4 <= len(header):
        (length,) = struct.unpack_from("<I", header, offset)
        name, _, value = header[offset + 4 : offset + 4 + length].partition(b"=")
        fields[name] = value
        offset += 4 + length
    return fields


def _topic(fields: Fields, body: bytes) -> Topic:
    about = _fields(body)
    metadata = {QOS: LATCHED} if about.get(b"latching") == b"1" else {}
    definition = about.get(b"message_definition", b"")
    kind = ros2_name(about.get(b"type", b"").decode())
    return Topic(fields[b"topic"].decode(), kind, "ros1", "ros1msg", definition, metadata)
