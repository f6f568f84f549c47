"""What every kind of bag gives: topics, and the bodies of their messages one after the other."""

from __future__ import annotations

import functools
import struct
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from pomona.errors import PomonaError

__all__ = [
    "LATEST_NS",
    "PICTURES",
    "TREES",
    "Message",
    "MessageFile",
    "Topic",
    "counted",
    "decoded",
    "missing_extra",
    "ros2_name",
    "stamp_ns",
]

TREES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
"""Types of the tree of transforms; the second one is from before 2013, and says the same."""

LATEST_NS = (1 << 63) - 1
"""Times are 64 bits with a sign from here on."""

MOST_MESSAGES = 10_000_000
"""Of the topics that are read at once: a day at 100 Hz."""

PICTURES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")

MOST_SMALL_BYTES = 1 << 24
"""16 MiB of a message that is no picture: a hundred thousand transforms."""


@dataclass(frozen=True)
class Topic:
    """One topic of a bag.

    Attributes
    ----------
    type : str
        As ROS 2 writes it: `sensor_msgs/msg/Image`.
    encoding : str
        `cdr` (ROS 2), `ros1`, or what an MCAP says.
    language, definition : str, bytes
        What the type is and in which language it says so, `ros2msg` and the like; nothing where the bag does not tell.
    metadata : mapping
        More about the topic, as an MCAP has it: `offered_qos_profiles`.
    """

    name: str
    type: str
    encoding: str
    language: str = ""
    definition: bytes = b""
    metadata: Mapping[str, str] = field(default_factory=dict, compare=False)


@dataclass(frozen=True, eq=False)
class Message:
    """A message that is not decoded.

    Attributes
    ----------
    logged_ns : int
        When the recorder received it; the header in the body says when it was made.
    published_ns : int or None
        When it was sent, where the bag knows that too.
    """

    topic: Topic
    logged_ns: int
    body: bytes
    published_ns: int | None = None


class MessageFile(Protocol):
    """A bag, open for as long as somebody reads from it."""

    @property
    def path(self) -> Path:
        """The file or folder."""

    @property
    def kind(self) -> str:
        """Name of the format."""

    @property
    def topics(self) -> dict[str, Topic]:
        """All topics by name."""

    @property
    def files(self) -> tuple[Path, ...]:
        """Files it consists of."""

    def messages(self, topics: Collection[str], start_ns: int | None = None) -> Iterator[Message]:
        """Read the messages of some topics, each topic's in the order in which they were logged.

        Parameters
        ----------
        topics : collection of str
            Names.
        start_ns : int, optional
            Leave out those that were logged earlier.
        """


def counted(path: Path, messages: Iterator[Message]) -> Iterator[Message]:
    """Give the messages on; what is noted of each must fit into memory.

    Raises
    ------
    PomonaError
        When there are more than `MOST_MESSAGES`.
    """
    for count, message in enumerate(messages):
        if count >= MOST_MESSAGES:
            raise PomonaError(
                f"{path}: found more than {MOST_MESSAGES} messages, expected a recording of a day at most"
            )
        yield message


def stamp_ns(message: Message) -> int:
    """Time in the message's header; only for types that begin with `std_msgs/Header`.

    ROS 1 writes seq, seconds and nanoseconds; CDR four bytes that tell the order of bytes, then seconds and
    nanoseconds.
    """
    try:
        if message.topic.encoding == "ros1":
            seconds, nanoseconds = struct.unpack_from("<II", message.body, 4)
        else:
            seconds, nanoseconds = struct.unpack_from("<iI" if message.body[1] & 1 else ">iI", message.body, 4)
    except (struct.error, IndexError):
        return 0
    return int(seconds) * 10**9 + int(nanoseconds)


def decoded(message: Message) -> Any:
    """Decode a message of one of ROS' common types; its fields are attributes.

    Raises
    ------
    PomonaError
        When the body is not what the type says.
    """
    if message.topic.type not in PICTURES and len(message.body) > MOST_SMALL_BYTES:
        raise PomonaError(f"{message.topic.name}: found a message of {len(message.body)} bytes, expected a small one")
    ros1 = message.topic.encoding == "ros1"
    store = _definitions(ros1)
    decode = store.deserialize_ros1 if ros1 else store.deserialize_cdr
    try:
        return decode(message.body, message.topic.type)
    except Exception as error:  # code made for the type runs over bytes of any kind, and has errors of any kind
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise PomonaError(f"{message.topic.name}: not a {message.topic.type} ({reason})") from None


@functools.cache
def _definitions(ros1: bool) -> Any:
    """Definitions of ROS 1 or ROS 2: they take a while to make, and sensor_msgs has not changed in either."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST)
    for name in TREES:
        if name not in store.fielddefs:
            store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    return store


def ros2_name(kind: str) -> str:
    """Name of a type as ROS 2 writes it; ROS 1 and some writers leave out the middle."""
    return kind.replace("/", "/msg/") if kind.count("/") == 1 else kind


def missing_extra(path: Path) -> PomonaError:
    """Say how to install what reads bags."""
    return PomonaError(f"{path}: a bag needs rosbags and mcap, which are not installed: pip install mcap rosbags")
