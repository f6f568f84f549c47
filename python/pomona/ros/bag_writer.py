"""Bags of ROS 2 as one MCAP file, written message by message."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from pomona.likes import MCAP_MARK
from pomona.recording.bags.message_file import Message, Topic, missing_extra
from pomona.recording.bags.quality_of_service import LATCHED, QOS
from pomona.ros.message_types import MessageTypes, known_store, store_types

__all__ = ["BagWriter", "MessageMaker"]


class BagWriter:
    """A new MCAP in an open file; `path` is what it is called in errors.

    Raises
    ------
    PomonaError
        When mcap or rosbags is not installed.
    """

    def __init__(self, file: BinaryIO, path: Path) -> None:
        try:
            from mcap.writer import Writer
        except ImportError:
            raise missing_extra(path) from None
        self._writer: Any = Writer(file)
        self._writer.start(profile="ros2", library=MCAP_MARK)
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[tuple[str, str, str], int] = {}

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if kind is None:
            self._writer.finish()

    def write(self, message: Message) -> None:
        """Append a message; those of one topic in the order in which they were logged."""
        # Two who write a topic may word its definition differently: it is one channel all the same.
        named = (message.topic.name, message.topic.type, message.topic.encoding)
        channel = self._channels.get(named)
        if channel is None:
            channel = self._channels[named] = self._channel(message.topic)
        published_ns = message.logged_ns if message.published_ns is None else message.published_ns
        self._writer.add_message(channel, message.logged_ns, message.body, published_ns)

    def _channel(self, topic: Topic) -> int:
        schema = (topic.type, topic.language, topic.definition)
        if topic.type and schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(*schema)
        number = self._schemas.get(schema, 0)  # 0: there is none
        return int(self._writer.register_channel(topic.name, topic.encoding, number, dict(topic.metadata)))


class MessageMaker:
    """Turns messages of rosbags' classes into those of a bag.

    Attributes
    ----------
    types : MessageTypes
        The classes.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._store = known_store()
        except ImportError:
            raise missing_extra(path) from None
        self.types: MessageTypes = store_types(self._store)
        self._topics: dict[str, Topic] = {}

    def __call__(self, name: str, content: Any, logged_ns: int, *, latched: bool = False) -> Message:
        """Serialise a message for a topic; a latched one reaches those who come late."""
        kind = str(content.__msgtype__)
        if name not in self._topics:
            text = self._store.generate_msgdef(kind, ros_version=2)[0].encode()
            self._topics[name] = Topic(name, kind, "cdr", "ros2msg", text, {QOS: LATCHED} if latched else {})
        body = bytes(self._store.serialize_cdr(content, kind, little_endian=True))
        return Message(self._topics[name], logged_ns, body)
