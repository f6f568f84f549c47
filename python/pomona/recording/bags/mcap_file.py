"""MCAP files, whole or cut off: chunk by chunk, so that one damaged chunk costs its own messages and no others."""

from __future__ import annotations

import struct
import warnings
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.bags.message_file import Message, Topic, missing_extra, ros2_name

__all__ = ["MAGIC", "McapFile"]

MAGIC = b"\x89MCAP0\r\n"

FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x0F
"""Operation codes of the records that matter here (mcap.dev/spec)."""

RECORD_HEAD = struct.Struct("<BQ")
"""Operation code and length of what follows."""


@dataclass(frozen=True)
class Piece:
    """A chunk, or a message outside of chunks: where it lies in the file, and from when to when it was logged."""

    operation: int
    offset: int
    length: int
    first_ns: int
    last_ns: int


@dataclass(frozen=True, eq=False)
class McapFile:
    """See `MessageFile`.

    Attributes
    ----------
    pieces : tuple of Piece
        In the order of the file; a chunk is some megabytes.
    """

    path: Path
    pieces: tuple[Piece, ...]
    topics: dict[str, Topic]
    _channels: dict[int, Topic]
    _damaged: set[int] = field(default_factory=set)
    _inhabitants: dict[int, frozenset[int]] = field(default_factory=dict)

    kind = "MCAP"

    @classmethod
    def open(cls, path: Path) -> McapFile:
        """Walk from record to record; nothing is decompressed unless the file was cut off before its summary.

        Raises
        ------
        PomonaError
            When it is no MCAP.
        """
        try:
            import mcap  # noqa: F401
        except ImportError:
            raise missing_extra(path) from None
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise PomonaError(f"{path}: not an MCAP file, or one without its beginning")
            pieces, channels, whole = _walk(file)
        opened = cls(path, tuple(pieces), {}, channels)
        if not whole:
            message = f"{path}: cut off: what is there is used"
            warnings.warn(message, PomonaWarning, stacklevel=4)
        if pieces and (not whole or not channels):
            for _ in opened.messages(()):
                pass
        opened.topics.update({topic.name: topic for topic in channels.values()})
        return opened

    @property
    def files(self) -> tuple[Path, ...]:
        """The file itself."""
        return (self.path,)

    def messages(self, topics: Collection[str], start_ns: int | None = None) -> Iterator[Message]:
        """Read in the order of the file, which for one topic is that of logging."""
        wanted = {number for number, topic in self._channels.items() if topic.name in topics}
        with self.path.open("rb") as file:
            for piece in self.pieces:
                inhabitants = self._inhabitants.get(piece.offset)
                if inhabitants is not None and not inhabitants & wanted:
                    continue  # A raw picture often fills a chunk: that of the other camera need not be decompressed.
                if start_ns is not None and piece.last_ns < start_ns:
                    continue
                for logged_ns, channel, body in self._inside(file, piece):
                    topic = self._channels.get(channel)
                    if topic is not None and topic.name in topics and (start_ns is None or logged_ns >= start_ns):
                        yield Message(topic, logged_ns, body)

    def _inside(self, file: BinaryIO, piece: Piece) -> Iterator[tuple[int, int, bytes]]:
        """Give (time, channel, body) of the messages in a piece; a damaged one has none, and is told once."""
        from mcap.records import Channel, Schema
        from mcap.records import Message as McapMessage

        file.seek(piece.offset)
        content = file.read(piece.length)
        if piece.operation == MESSAGE:
            channel, _, logged_ns, _ = struct.unpack_from("<HIQQ", content)
            yield logged_ns, channel, content[22:]
            return
        schemas: dict[int, Any] = {}
        records = self._records(piece, content)
        channels = frozenset(record.channel_id for record in records if isinstance(record, McapMessage))
        self._inhabitants.setdefault(piece.offset, channels)
        for record in records:
            if isinstance(record, McapMessage):
                yield record.log_time, record.channel_id, record.data
            elif isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel) and record.id not in self._channels:
                self._channels[record.id] = _topic(record, schemas)

    def _records(self, piece: Piece, content: bytes) -> list[Any]:
        from mcap.data_stream import ReadDataStream
        from mcap.records import Chunk
        from mcap.stream_reader import breakup_chunk

        try:
            return list(breakup_chunk(Chunk.read(ReadDataStream(BytesIO(content))), validate_crc=True))
        except Exception as error:  # zstandard, lz4 and struct have each their own
            if piece.offset not in self._damaged:
                self._damaged.add(piece.offset)
                reason = (str(error).splitlines() or [type(error).__name__])[0]
                message = f"{self.path}: the chunk at byte {piece.offset} is damaged and left out ({reason})"
                warnings.warn(message, PomonaWarning, stacklevel=2)
            return []


def _walk(file: BinaryIO) -> tuple[list[Piece], dict[int, Topic], bool]:
    """Find the pieces, the channels outside of them, and whether the file goes on to its end."""
    from mcap.data_stream import ReadDataStream
    from mcap.records import Channel, Schema

    pieces: list[Piece] = []
    schemas: dict[int, Any] = {}
    channels: dict[int, Topic] = {}
    size = file.seek(0, 2)
    offset, ended = len(MAGIC), False
    while offset + RECORD_HEAD.size <= size:
        file.seek(offset)
        operation, length = RECORD_HEAD.unpack(file.read(RECORD_HEAD.size))
        offset += RECORD_HEAD.size
        if offset + length > size:
            break
        if operation in (CHUNK, MESSAGE):
            head = file.read(16 if operation == CHUNK else 22)
            first_ns, last_ns = struct.unpack("<QQ", head) if operation == CHUNK else (_logged_ns(head),) * 2
            pieces.append(Piece(operation, offset, length, first_ns, last_ns))
        elif operation == SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(file.read(length))))
            schemas[schema.id] = schema
        elif operation == CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(file.read(length))))
            channels[channel.id] = _topic(channel, schemas)
        ended = ended or operation == DATA_END
        if operation == FOOTER:
            break
        offset += length
    return pieces, channels, ended


def _logged_ns(head: bytes) -> int:
    return int(struct.unpack("<HIQQ", head)[2])


def _topic(channel: Any, schemas: dict[int, Any]) -> Topic:
    schema = schemas.get(channel.schema_id)
    name = "" if schema is None else str(schema.name)
    return Topic(str(channel.topic), ros2_name(name), str(channel.message_encoding))
