"""Fruits as a file that Foxglove opens: one scene in an MCAP."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from pomona.atomic import whole_file
from pomona.cloud import FruitCloud
from pomona.ros.bag_writer import BagWriter, MessageMaker
from pomona.ros.foxglove_scene import fruits_scene

__all__ = ["write_scene"]

FRAME = "map"
TOPIC = "/pomona/fruits"


def write_scene(path: Path, fruits: FruitCloud) -> None:
    """Write fruits as one `foxglove_msgs/SceneUpdate`, at the day on which the last of them was seen.

    Raises
    ------
    PomonaError
        When mcap or rosbags is not installed, or the file cannot be written.
    """
    maker = MessageMaker(path)
    at_ns = _last_day_ns(fruits)
    scene = maker(TOPIC, fruits_scene(maker.types, at_ns, FRAME, fruits), at_ns, latched=True)
    with whole_file(path) as partial, partial.open("wb") as file, BagWriter(file, path) as writer:
        writer.write(scene)


def _last_day_ns(fruits: FruitCloud) -> int:
    """Midnight of that day, UTC; 0 where no fruit has one."""
    last = max(fruits.extras.get("last_seen", ()), default="")
    try:
        return int(datetime.fromisoformat(last).replace(tzinfo=UTC).timestamp()) * 10**9
    except ValueError:
        return 0
