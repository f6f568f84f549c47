"""From a bag to a recording: topics, cameras, pairs, poses."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pomona.errors import PomonaError
from pomona.recording.bags.bag_recording import BagRecording
from pomona.recording.bags.cameras import optics_of, registration_of, without_depth
from pomona.recording.bags.contents import Contents, read_contents
from pomona.recording.bags.frames import posed, simultaneous
from pomona.recording.bags.kinds import open_messages, rest_of
from pomona.recording.bags.message_file import missing_extra
from pomona.recording.bags.pose_messages import camera_poses
from pomona.recording.bags.ros_bag import DamagedBagError
from pomona.recording.bags.topics import chosen_topics

__all__ = ["open_bag"]


def open_bag(
    path: Path, calibration: Path | None = None, topics: Mapping[str, str] | None = None, *, own_poses: bool = True
) -> BagRecording:
    """Open a bag: it is read once from beginning to end, and its pictures are not decoded.

    Parameters
    ----------
    path : Path
        A .bag, .mcap or .db3, or the folder of a ROS 2 bag.
    calibration : Path, optional
        Instead of the camera_info in it.
    topics : mapping, optional
        Topic of each role of `ROLES`, where they are not found by their names.
    own_poses : bool
        Whether poses in it are read.

    Raises
    ------
    PomonaError
        When pictures or cameras are missing, not clear, or do not fit together.
    """
    try:
        import rosbags  # noqa: F401
    except ImportError:
        raise missing_extra(path) from None
    topics = topics if own_poses else {**(topics or {}), "poses": "none"}
    file = open_messages(path)
    roles = chosen_topics(path, file.topics, topics)
    try:
        contents = read_contents(file, roles)
    except DamagedBagError:
        file = rest_of(path)
        roles = chosen_topics(path, file.topics, topics)
        contents = read_contents(file, roles)
    _require_kinds(path, contents)
    optics = optics_of(path, roles, contents, calibration)
    try:
        registration = registration_of(path, roles, contents, optics)
    except PomonaError as reason:
        if "right" not in contents.pictures:
            raise
        registration, roles = None, without_depth(roles, contents, reason)
    rows = simultaneous(path, contents.pictures)
    rows, trajectory = posed(path, contents.pictures, rows, camera_poses(path, file, roles, contents), optics)
    return BagRecording(path, file, roles, optics, contents.pictures, rows, trajectory, registration)


def _require_kinds(path: Path, contents: Contents) -> None:
    left, right, depth = (contents.pictures.get(kind) for kind in ("left", "right", "depth"))
    if depth is not None and not depth.depth:
        raise PomonaError(f"{path}: {depth.topic.name}: found colour or grey, expected depth")
    if left is not None and right is not None and left.size_px != right.size_px:
        sizes = " and ".join("{}x{}".format(*each.size_px) for each in (left, right))
        names = f"{left.topic.name} and {right.topic.name}"
        raise PomonaError(f"{path}: {names}: found {sizes} pixels, expected equal sizes")
