"""Messages of ROS 1 as those of ROS 2: the same fields in CDR, headers without their count."""

from __future__ import annotations

import functools
import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.bags.message_file import Message, Topic
from pomona.recording.bags.unpacked import MOST_CHUNK_BYTES
from pomona.ros.message_types import known_store

__all__ = ["AsRos2"]

HEADER = "std_msgs/msg/Header"
OLD_TREE, TREE = "tf/msg/tfMessage", "tf2_msgs/msg/TFMessage"

TYPE_NAME = re.compile(r"[A-Za-z]\w*/msg/[A-Za-z]\w*", re.ASCII)
"""rosbags makes code of a type's name and definition, and looks at the definition only."""

LARGE_ARRAY = re.compile(rb"\[<?=?\d{7,}\]")
"""Of a fixed size of ten million and more: reading one of empty things would not end."""

Body = Callable[[bytes], bytes]


class AsRos2:
    """Turns messages of any bag into those that a bag of ROS 2 has; what is of no ROS stays as it is."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[Topic, tuple[Topic, Body]] = {}
        self._told: set[Topic] = set()

    def __call__(self, message: Message) -> Message | None:
        """Give the message as ROS 2 has it; None, and one warning a topic, for one that is not what its type says."""
        try:
            if message.topic not in self._known:
                self._known[message.topic] = _prepared(message.topic)
            topic, body = self._known[message.topic]
            return replace(message, topic=topic, body=body(message.body))
        except Exception as error:  # code made for a stranger's type runs over bytes of any kind
            self._tell(message.topic, error)
            return None

    def _tell(self, topic: Topic, error: Exception) -> None:
        if topic not in self._told:
            self._told.add(topic)
            reason = (str(error).splitlines() or [type(error).__name__])[0]
            found = f"found a message that is no {topic.type} ({reason})"
            warnings.warn(f"{self._path}: {topic.name}: {found}: left out", PomonaWarning, stacklevel=3)


def _prepared(topic: Topic) -> tuple[Topic, Body]:
    """Say what a topic becomes, and how its messages do."""
    if topic.encoding != "ros1":
        return _defined(topic), bytes
    store, kind = _store_of(topic), _ros2_type(topic)
    text = store.generate_msgdef(kind, ros_version=2)[0].encode()
    made = replace(topic, type=kind, encoding="cdr", language="ros2msg", definition=text)
    return made, lambda body: bytes(store.ros1_to_cdr(body, kind))


def _ros2_type(topic: Topic) -> str:
    return TREE if topic.type == OLD_TREE else topic.type


def _defined(topic: Topic) -> Topic:
    """Say what a type of ROS 2 is where the bag does not, as those in SQLite."""
    store = _ros2_store()
    if topic.encoding != "cdr" or topic.definition or topic.type not in store.fielddefs:
        return topic
    text = store.generate_msgdef(topic.type, ros_version=2)[0].encode()
    return replace(topic, language="ros2msg", definition=text)


@functools.cache
def _ros2_store() -> Any:
    return known_store()


def _store_of(topic: Topic) -> Any:
    """Types of ROS 2 with that of a topic: theirs where it has the same fields, which name them in small letters."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    from rosbags.typesys.base import TypesysError

    if TYPE_NAME.fullmatch(topic.type) is None or LARGE_ARRAY.search(topic.definition):
        raise PomonaError("found a name or an array that no type has")
    store = known_store()
    types = get_types_from_msg(topic.definition.decode(errors="replace"), _ros2_type(topic))
    types[HEADER] = store.fielddefs[HEADER]
    try:
        store.register(types)
    except TypesysError:
        store = get_typestore(Stores.EMPTY)
        store.register(types)
    store.max_sequence_length = MOST_CHUNK_BYTES
    return store
