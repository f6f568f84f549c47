"""What a replay reads of a bag besides its pictures: the tree of transforms, and every message as ROS 2 has it."""

from __future__ import annotations

from fuzz import bags
from fuzz.bundle import unpacked
from pomona.recording.bags.kinds import open_messages
from pomona.ros.ros1_as_ros2 import AsRos2
from pomona.ros.transform_tree import read_tree


def seeds() -> list[bytes]:
    """Those of the bags."""
    return bags.seeds()


def target(content: bytes) -> None:
    """Read the tree and turn all messages."""
    with unpacked(content) as (_, folder):
        for place in sorted(folder.iterdir()):
            file = open_messages(place)
            tree = read_tree(file)
            tree.body_of("cam")
            as_ros2 = AsRos2(place)
            for message in file.messages(file.topics.keys()):
                as_ros2(message)
