"""What is read of a bag when it is opened: times of the pictures, cameras, and frames of reference that stand still."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import number_in
from pomona.recording.bags.message_file import Message, MessageFile, Topic, counted, decoded, stamp_ns
from pomona.recording.bags.picture_messages import is_depth, size_of
from pomona.recording.bags.realsense import is_depth_unit, is_extrinsics, static_transform, stream_frame
from pomona.recording.bags.topics import Roles

__all__ = ["Contents", "PictureTopic", "read_contents"]

STATIC = "/tf_static"

DEPTH_UNIT_M = 0.001
"""Whole numbers are millimetres (REP 118), unless a recorder says otherwise."""

AFTER_STAMP = 12
"""Bytes of sequence number or encapsulation and of the time, before what a camera_info says."""


MOST_INFOS = 100
"""Different camera_info of one topic that are kept; two are too many already."""


@dataclass(eq=False)
class PictureTopic:
    """The pictures of one topic.

    Attributes
    ----------
    stamps_ns, logged_ns : (M,) int64
        When each was taken, ascending, and when the recorder received it.
    size_px : (width, height)
        Of the first one that can be read.
    depth : bool
        Whether they hold depth.
    frame : str
        Name of the camera's frame of reference.
    """

    topic: Topic
    stamps_ns: NDArray[np.int64]
    logged_ns: NDArray[np.int64]
    size_px: tuple[int, int]
    depth: bool
    frame: str


@dataclass(eq=False)
class Contents:
    """See the module.

    Attributes
    ----------
    pictures : dict
        For `left`, `right`, `depth`, as there are.
    infos : dict
        For each topic of a camera_info the different ones on it, decoded.
    static : list
        Decoded `TransformStamped` that hold for the whole recording.
    depth_unit_m : float
        A step of depth pictures of whole numbers.
    """

    pictures: dict[str, PictureTopic]
    infos: dict[str, list[Any]]
    static: list[Any]
    depth_unit_m: float = DEPTH_UNIT_M


@dataclass(eq=False)
class _Seen:
    """One topic of pictures while it is read."""

    topic: Topic
    stamps_ns: list[int] = field(default_factory=list)
    logged_ns: list[int] = field(default_factory=list)
    example: Any = None
    size_px: tuple[int, int] | None = None

    def add(self, message: Message) -> None:
        self.stamps_ns.append(stamp_ns(message))
        self.logged_ns.append(message.logged_ns)
        if self.size_px is None:
            try:
                example = decoded(message)
                self.size_px, self.example = size_of(self.topic.name, example), example
            except PomonaError:
                return


def read_contents(file: MessageFile, roles: Roles) -> Contents:
    """Read a bag once, and decode of each topic of pictures the first one only.

    Raises
    ------
    PomonaError
        When a topic has no picture that can be read, or its times go back.
    """
    seen = {topic: _Seen(file.topics[topic]) for topic in roles.pictures.values()}
    info_topics = [name for name in (roles.left_info, roles.right_info, roles.depth_info) if name is not None]
    infos: dict[str, dict[bytes, Any]] = {name: {} for name in info_topics}
    found = Contents({}, {}, [])
    places = {name for name in file.topics if name == STATIC or is_extrinsics(name) or is_depth_unit(name)}
    for message in counted(file.path, file.messages({*seen, *infos, *places})):
        name = message.topic.name
        if name in seen:
            seen[name].add(message)
        elif name in infos:
            said = message.body[AFTER_STAMP:]
            if said not in infos[name] and len(infos[name]) < MOST_INFOS:
                infos[name][said] = decoded(message)
        elif name == STATIC:
            found.static.extend(decoded(message).transforms)
        elif is_extrinsics(name):
            found.static.append(static_transform(name, decoded(message)))
        else:
            found.depth_unit_m = number_in(f"{file.path}: {name}", "data", decoded(message).data)
    found.pictures.update({kind: _listed(file, seen[topic]) for kind, topic in roles.pictures.items()})
    found.infos.update({name: list(each.values()) for name, each in infos.items()})
    return found


def _listed(file: MessageFile, seen: _Seen) -> PictureTopic:
    where = f"{file.path}: {seen.topic.name}"
    if seen.size_px is None:
        raise PomonaError(f"{where}: found {len(seen.stamps_ns)} pictures and none that can be read")
    logged_ns = np.array(seen.logged_ns, np.int64)
    stamps_ns = np.array(seen.stamps_ns, np.int64)
    if not stamps_ns.any():  # a driver that leaves the header empty
        stamps_ns = logged_ns
    back = np.flatnonzero(np.diff(stamps_ns) <= 0)
    if len(back):
        row = int(back[0]) + 1
        times = f"from {stamps_ns[row - 1] / 1e9:.3f} s to {stamps_ns[row] / 1e9:.3f} s"
        raise PomonaError(f"{where}: picture {row}: time goes back {times}, expected ascending times")
    frame = stream_frame(seen.topic.name) or str(seen.example.header.frame_id)
    return PictureTopic(seen.topic, stamps_ns, logged_ns, seen.size_px, is_depth(seen.example), frame)
