"""Where the camera was, as a bag tells it: odometry, stamped poses, or the tree of transforms."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.bags.contents import Contents
from pomona.recording.bags.frames_of_reference import Joint, bare_name, joint_of, matrix_of, path_between
from pomona.recording.bags.message_file import TREES, MessageFile, counted, decoded, stamp_ns
from pomona.recording.bags.topics import Roles

__all__ = ["Known", "camera_poses"]

ODOMETRY = "nav_msgs/msg/Odometry"
STAMPED = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")

WORLDS = ("map", "odom", "world", "earth", "odom_combined")
"""Names of frames that do not move with the robot (REP 105)."""

Known = tuple[NDArray[np.int64], NDArray[np.float64]]
"""Times in nanoseconds (K,), ascending, and session_from_camera (K, 4, 4), of the camera as it was recorded."""


def camera_poses(path: Path, file: MessageFile, roles: Roles, contents: Contents) -> Known | None:
    """Read the poses of the left camera: those of the topic that was given, else the only odometry, else the tree.

    Odometry is of a frame on the robot; where `/tf_static` does not say how the camera sits on it, it is not used, and
    a warning says so. A stamped pose does not say of what it is: it is only used when it was given, as the camera's.

    Raises
    ------
    PomonaError
        When a topic that was given holds no poses.
    """
    if roles.poses == "none":
        return None
    camera = next(iter(contents.pictures.values())).frame
    if roles.poses is not None:
        kind = file.topics[roles.poses].type
        if kind in TREES:
            return _of_tree(path, file, contents, camera, roles.poses)
        if kind != ODOMETRY and kind not in STAMPED:
            raise PomonaError(f"{path}: {roles.poses}: found {kind}, expected Odometry, a stamped pose or a TFMessage")
        return _of_topic(path, file, contents, camera, roles.poses)
    odometries = [name for name, topic in file.topics.items() if topic.type == ODOMETRY]
    if len(odometries) == 1:
        return _of_topic(path, file, contents, camera, odometries[0])
    if odometries:
        _tell(
            f"{path}: found odometry on {', '.join(sorted(odometries))}, none is used: choose with --topics poses=/..."
        )
        return None
    trees = [name for name, topic in file.topics.items() if topic.type in TREES and name.rpartition("/")[2] == "tf"]
    known = _of_tree(path, file, contents, camera, trees[0]) if len(trees) == 1 else None
    stamped = sorted(name for name, topic in file.topics.items() if topic.type in STAMPED)
    if known is None and stamped:
        _tell(
            f"{path}: found poses on {', '.join(stamped)} that do not say of what: not used, --topics poses=/... does"
        )
    return known


def _of_topic(path: Path, file: MessageFile, contents: Contents, camera: str, topic: str) -> Known | None:
    """Odometry or stamped poses, moved from the body to the camera."""
    times_ns: list[int] = []
    poses: list[NDArray[np.float64]] = []
    body = ""
    for message in counted(path, file.messages({topic})):
        content = decoded(message)
        pose = content.pose.pose if hasattr(content.pose, "pose") else content.pose
        body = str(getattr(content, "child_frame_id", ""))
        matrix = matrix_of(pose.position, pose.orientation)
        if matrix is not None:
            times_ns.append(stamp_ns(message) or message.logged_ns)
            poses.append(matrix)
    if not poses:
        return None
    if body:
        body_from_camera = path_between(contents.static, body, camera)
        if body_from_camera is None:
            lacking = f"/tf_static does not lead from there to the camera, {camera or 'which has no frame'}"
            _tell(f"{path}: {topic}: poses are of {body}, and {lacking}: they are not used")
            return None
    else:
        _tell(
            f"{path}: {topic}: poses do not say of which frame: taken as the left camera's, x right, y down, z forward"
        )
        body_from_camera = np.eye(4)
    return _ascending(times_ns, np.array(poses) @ body_from_camera)


def _of_tree(path: Path, file: MessageFile, contents: Contents, camera: str, topic: str) -> Known | None:
    """Walk from the camera up to the world; the joint that moves gives the times."""
    parents = {joint.child: joint.parent for joint in filter(None, map(joint_of, contents.static))}
    moving: set[str] = set()
    for each, _ in _joints(file, topic):
        parents[each.child] = each.parent
        moving.add(each.child)
    chain = [bare_name(camera)]
    while chain[-1] in parents and parents[chain[-1]] not in chain:
        chain.append(parents[chain[-1]])
    joints = [frame for frame in chain[:-1] if frame in moving]
    if chain[-1] in parents or chain[-1].rpartition("/")[2] not in WORLDS or not joints:
        return None  # frames that go in a circle have no top
    if len(joints) > 1:
        names = ", ".join(f"{parents[joint]} to {joint}" for joint in joints)
        _tell(f"{path}: {topic}: several joints move between {chain[-1]} and the camera ({names}): none is used")
        return None
    joint = joints[0]
    above = path_between(contents.static, chain[-1], parents[joint]) if parents[joint] != chain[-1] else np.eye(4)
    below = path_between(contents.static, joint, camera) if joint != bare_name(camera) else np.eye(4)
    if above is None or below is None:
        return None
    times_ns: list[int] = []
    poses: list[NDArray[np.float64]] = []
    for each, at_ns in _joints(file, topic):
        if each.child == joint and each.parent == parents[joint]:
            times_ns.append(at_ns)
            poses.append(each.parent_from_child)
    return _ascending(times_ns, above @ np.array(poses) @ below)


def _joints(file: MessageFile, topic: str) -> Iterator[tuple[Joint, int]]:
    for message in counted(file.path, file.messages({topic})):
        for each in decoded(message).transforms:
            stamp, joint = each.header.stamp, joint_of(each)
            if joint is not None:
                yield joint, int(stamp.sec) * 10**9 + int(stamp.nanosec) or message.logged_ns


def _ascending(times_ns: list[int], poses: NDArray[np.float64]) -> Known:
    """Sort by time; of those of one time the first counts."""
    times, first = np.unique(np.array(times_ns, np.int64), return_index=True)
    return times, np.asarray(poses[first])


def _tell(message: str) -> None:
    warnings.warn(message, PomonaWarning, stacklevel=5)
