"""MCAP files, whole or cut off: chunk by chunk, so that one damaged chunk costs its own messages and no others."""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.bags.message_file import LATEST_NS, Message, Topic, missing_extra, ros2_name
from pomona.recording.bags.unpacked import unpacked

__all__ = ["MAGIC", "McapFile"]

MAGIC = b"\x89MCAP0\r\n"

FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x0F
"""Operation codes of the records that matter here (mcap.dev/spec)."""

RECORD_HEAD = struct.Struct("<BQ")
"""Operation code and length of what follows."""

CHUNK_HEAD, MESSAGE_HEAD = struct.Struct("<QQ"), struct.Struct("<HIQQ")
"""First and last time of a chunk; channel, sequence, time of logging and of publishing of a message."""

DAMAGES = (ValueError, struct.error)
"""What records, texts and chunks raise that are not what they say."""


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
    _schemas: dict[int, Any]
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
            try:
                pieces, channels, schemas, whole = _walk(file)
            except DAMAGES as error:
                raise PomonaError(f"{path}: a damaged MCAP ({error})") from None
        opened = cls(path, tuple(pieces), {}, channels, schemas)
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
                for channel, logged_ns, published_ns, body in self._inside(file, piece):
                    topic = self._channels.get(channel)
                    if topic is not None and topic.name in topics and (start_ns is None or logged_ns >= start_ns):
                        yield Message(topic, logged_ns, body, published_ns)

    def _inside(self, file: BinaryIO, piece: Piece) -> Iterator[tuple[int, int, int, bytes]]:
        """Give channel, both times and body of the messages in a piece; a damaged one has none, and is told once."""
        file.seek(piece.offset)
        content = file.read(piece.length)
        if piece.operation == MESSAGE:
            yield *_head(content, 0), content[MESSAGE_HEAD.size :]
            return
        try:
            plain = self._chunk(piece, content)
        except DAMAGES as error:
            self._tell(piece, error)
            return
        for operation, start, end in _records(plain):
            if operation == MESSAGE:
                yield *_head(plain, start), plain[start + MESSAGE_HEAD.size : end]

    def _chunk(self, piece: Piece, content: bytes) -> bytes:
        """Unpack a chunk that is whole; note the channels in it, and schemas, which those of later chunks may name."""
        chunk = _record("Chunk", content)
        plain = unpacked(chunk.compression, chunk.data, chunk.uncompressed_size)
        if chunk.uncompressed_crc not in (0, zlib.crc32(plain)):
            raise ValueError("its checksum is another")
        inhabitants: set[int] = set()
        for operation, start, end in _records(plain):
            if operation == MESSAGE:
                inhabitants.add(_head(plain[start:end], 0)[0])
            elif operation == SCHEMA:
                schema = _record("Schema", plain[start:end])
                self._schemas.setdefault(schema.id, schema)
            elif operation == CHANNEL:
                channel = _record("Channel", plain[start:end])
                self._channels.setdefault(channel.id, _topic(channel, self._schemas))
        self._inhabitants.setdefault(piece.offset, frozenset(inhabitants))
        return plain

    def _tell(self, piece: Piece, error: Exception) -> None:
        if piece.offset not in self._damaged:
            self._damaged.add(piece.offset)
            reason = (str(error).splitlines() or [type(error).__name__])[0]
            message = f"{self.path}: the chunk at byte {piece.offset} is damaged and left out ({reason})"
            warnings.warn(message, PomonaWarning, stacklevel=2)


def _records(plain: bytes) -> Iterator[tuple[int, int, int]]:
    """Give operation, begin and end of each record of a chunk."""
    at = 0
    while at < len(plain):
        operation, length = RECORD_HEAD.unpack_from(plain, at)
        at += RECORD_HEAD.size
        if at + length > len(plain):
            raise ValueError("a record is longer than its chunk")
        yield operation, at, at + length
        at += length


def _head(content: bytes, start: int) -> tuple[int, int, int]:
    """Channel of a message, and when it was logged and published."""
    channel, _, logged_ns, published_ns = MESSAGE_HEAD.unpack_from(content, start)
    return channel, min(logged_ns, LATEST_NS), min(published_ns, LATEST_NS)


def _walk(file: BinaryIO) -> tuple[list[Piece], dict[int, Topic], dict[int, Any], bool]:
    """Find the pieces, the channels and schemas outside of them, and whether the file goes on to its end."""
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
            piece = _piece(file, operation, offset, length)
            pieces.extend([] if piece is None else [piece])
        elif operation == SCHEMA:
            schema = _record("Schema", file.read(length))
            schemas[schema.id] = schema
        elif operation == CHANNEL:
            channel = _record("Channel", file.read(length))
            channels[channel.id] = _topic(channel, schemas)
        ended = ended or operation == DATA_END
        if operation == FOOTER:
            break
        offset += length
    return pieces, channels, schemas, ended


def _piece(file: BinaryIO, operation: int, offset: int, length: int) -> Piece | None:
    """Read the head of a chunk or a message; None for one that is too short to be any."""
    head = CHUNK_HEAD if operation == CHUNK else MESSAGE_HEAD
    if length < head.size:
        return None
    content = file.read(head.size)
    first_ns, last_ns = head.unpack(content) if operation == CHUNK else (_head(content, 0)[1],) * 2
    return Piece(operation, offset, length, first_ns, last_ns)


def _record(kind: str, content: bytes) -> Any:
    """Read a `Chunk`, a `Schema` or a `Channel`."""
    from mcap import records
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError

    try:
        return getattr(records, kind).read(ReadDataStream(BytesIO(content)))
    except (McapError, struct.error, UnicodeDecodeError, OverflowError) as error:
        raise ValueError(f"a {kind.lower()} that cannot be read: {error or type(error).__name__}") from None


def _topic(channel: Any, schemas: dict[int, Any]) -> Topic:
    schema = schemas.get(channel.schema_id)
    name, encoding = str(channel.topic), str(channel.message_encoding)
    if schema is None:
        return Topic(name, "", encoding, metadata=dict(channel.metadata))
    return Topic(
        name, ros2_name(str(schema.name)), encoding, str(schema.encoding), bytes(schema.data), dict(channel.metadata)
    )
