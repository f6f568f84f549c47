"""The story of a replay: bag -> where its camera was, frame by frame -> the same bag with our messages in it."""

from __future__ import annotations

import heapq
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

from pomona.atomic import whole_file
from pomona.cloud import Cloud, as_cloud
from pomona.detect import Detector
from pomona.errors import PomonaError
from pomona.localize import Localizer, Way
from pomona.localize.following import Progress, localize
from pomona.match_arguments import Up
from pomona.reading import shown
from pomona.recording import Recording
from pomona.recording.bags.bag_recording import BagRecording
from pomona.recording.bags.message_file import Message, MessageFile
from pomona.ros.bag_frames import BagFrames, frames_of_bag
from pomona.ros.bag_writer import BagWriter, MessageMaker
from pomona.ros.localized_messages import OWN, localized_messages
from pomona.ros.map_axes import map_axes
from pomona.ros.ros1_as_ros2 import AsRos2
from pomona.streams import is_stream

__all__ = ["Replayed", "replay", "require_bag", "require_unused"]


@dataclass(frozen=True, eq=False)
class Replayed:
    """What was done.

    Attributes
    ----------
    localizer : Localizer
        The map.
    way : Way
        Where the camera was.
    frames : BagFrames
        In which frames that was told.
    n_copied, n_added : int
        Messages of the bag, and of ours.
    """

    localizer: Localizer
    way: Way
    frames: BagFrames
    n_copied: int
    n_added: int


def require_bag(recording: Recording) -> BagRecording:
    """Take a recording that is a bag, and not one of ours.

    Raises
    ------
    PomonaError
        When it is something else, or has our messages already.
    """
    if not isinstance(recording, BagRecording):
        found = recording.description()["kind"]
        raise PomonaError(f"{recording.path}: found {found}, expected a bag: .mcap, .bag, .db3 or a ROS 2 folder")
    ours = sorted(name for name in recording.file.topics if name.startswith(OWN))
    if ours:
        found = f"found {ours[0]}, as in a bag that was replayed already"
        raise PomonaError(f"{recording.path}: {found}: expected the bag as it was recorded")
    return recording


def replay(
    recording: Recording,
    detector: Detector,
    orchard: Cloud,
    output: Path,
    *,
    map_frame: str = "map",
    single: bool = False,
    depth: str = "auto",
    odometry: bool = False,
    up: Up | None = None,
    config: Mapping[str, Any] | None = None,
    threads: int | None = None,
    index: str | Path | None = None,
    progress: Progress | None = None,
) -> Replayed:
    """Localise a bag in a map, and write it with what a localiser on the robot would have said.

    Parameters
    ----------
    recording : Recording
        A bag.
    detector : Detector
        Gives boxes.
    orchard : FruitCloud, OrchardMap, Session, array_like, str or Path
        The map, as for `pomona.Localizer`.
    output : Path
        The MCAP to write; nothing may be there.
    map_frame : str
        What the frame of the map is called.
    single, depth, odometry, up, progress : optional
        As in `pomona.localize.following.localize`; `up` also levels the frame of the map where it has no georeference.
    config, threads, index : optional
        As in `pomona.Localizer`.

    Raises
    ------
    PomonaError
        When the recording is no bag or was replayed already, there is something at `output`, or it cannot be written.
    """
    require_unused(output)
    if not re.fullmatch(r"[\w./-]+", map_frame):
        raise PomonaError(f"--map-frame: found {shown(map_frame)}, expected a name of letters, digits and _ . / -")
    bag, maker, fruits = require_bag(recording), MessageMaker(output), as_cloud(orchard)
    localizer = Localizer(fruits, config=config, threads=threads, index=index)
    frames = frames_of_bag(bag, map_frame, map_axes(orchard, up))
    way = localize(bag, detector, localizer, single=single, depth=depth, odometry=odometry, up=up, progress=progress)
    theirs, ours = _Counted(_copied(bag.file)), _Counted(localized_messages(maker, bag, way, frames, fruits))
    with whole_file(output) as partial:
        with partial.open("wb") as file, BagWriter(file, output) as writer:
            # Theirs come first where the time is the same, and keep their order where theirs goes back.
            for message in heapq.merge(theirs, ours, key=attrgetter("logged_ns")):
                writer.write(message)
        require_unused(output)  # something may have come there meanwhile
    return Replayed(localizer, way, frames, theirs.count, ours.count)


def require_unused(output: Path) -> None:
    """Refuse to write where something is: a bag may be all that is left of a day.

    Raises
    ------
    PomonaError
        When something is there, or its name is that of another kind of file.
    """
    if is_stream(output):
        return
    if output.suffix.lower() != ".mcap":
        raise PomonaError(f"{output}: found suffix {output.suffix!r}, expected .mcap: that is what is written")
    if output.exists():
        raise PomonaError(f"{output}: is there already, expected a new file: nothing is overwritten")


def _copied(file: MessageFile) -> Iterator[Message]:
    """Give all messages of a bag, as ROS 2 has them."""
    as_ros2 = AsRos2(file.path)
    for message in file.messages(file.topics.keys()):
        made = as_ros2(message)
        if made is not None:
            yield made


class _Counted:
    """Messages, and how many there have been."""

    def __init__(self, messages: Iterator[Message]) -> None:
        self._messages, self.count = messages, 0

    def __iter__(self) -> Iterator[Message]:
        for message in self._messages:
            self.count += 1
            yield message
