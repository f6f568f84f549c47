"""What a localiser on the robot would have said: a recording's poses as messages, in the order of time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pomona.cloud import FruitCloud
from pomona.localize import Step, Way
from pomona.recording.bags.bag_recording import BagRecording
from pomona.recording.bags.message_file import Message
from pomona.ros.bag_frames import BagFrames
from pomona.ros.bag_writer import MessageMaker
from pomona.ros.foxglove_scene import fruits_scene, robot_scene
from pomona.ros.robot_frames import BODY_FROM_OPTICAL, RobotPose
from pomona.ros.robot_messages import (
    detections_message,
    odometry_message,
    path_message,
    pose_message,
    sightings_of,
    transforms_message,
)

__all__ = ["OWN", "localized_messages"]

OWN = "/pomona/"
"""Begins the names of our topics, but those of the tree of transforms."""

PATH_GROWS = 1.1
"""The path is told when it has grown so far: all of them together are then ten times the last, not its square."""


def localized_messages(
    maker: MessageMaker, recording: BagRecording, way: Way, frames: BagFrames, fruits: FruitCloud
) -> Iterator[Message]:
    """Give the messages of every frame, logged when the last of its pictures was.

    Parameters
    ----------
    maker : MessageMaker
    recording : BagRecording
    way : Way
        Its frames, localised.
    frames : BagFrames
    fruits : FruitCloud
        The map as the localiser was given it.
    """
    types, robot = maker.types, frames.robot
    times, last = _Times(recording), way.found[-1:]
    yield from _of_start(maker, frames, fruits, times.logged_ns(way.steps[0]))
    path: list[RobotPose] = []
    told = 0
    for step in way.steps:
        stamp_ns, logged_ns = times.stamp_ns(step), times.logged_ns(step)
        yield maker(f"{OWN}status", types("std_msgs/msg/String")(data=str(step.found.status)), logged_ns)
        seen, known = step.cloud.transformed(robot.optical_from_camera), sightings_of(step.found, fruits)
        yield maker(f"{OWN}detections", detections_message(types, stamp_ns, robot.camera, seen, known), logged_ns)
        if not step.found:
            continue
        pose = robot.place(step.found, stamp_ns)
        for name, content in _of_pose(types, frames, pose, path[-1] if path else None):
            yield maker(name, content, logged_ns)
        path.append(pose)
        if len(path) >= PATH_GROWS * told or step in last:
            told = len(path)
            yield maker(f"{OWN}path", path_message(types, robot.map, path), logged_ns)


def _of_start(maker: MessageMaker, frames: BagFrames, fruits: FruitCloud, start_ns: int) -> Iterator[Message]:
    """Give what is said once: the map, and where a body is that the bag does not know."""
    types, robot = maker.types, frames.robot
    scene = fruits_scene(types, start_ns, robot.map, fruits.transformed(robot.map_from_fruits))
    yield maker(f"{OWN}fruits", scene, start_ns, latched=True)
    if frames.body_is_new:
        own_body = (robot.camera, robot.base, np.linalg.inv(BODY_FROM_OPTICAL))
        yield maker("/tf_static", transforms_message(types, start_ns, own_body), start_ns, latched=True)


def _of_pose(types: Any, frames: BagFrames, pose: RobotPose, before: RobotPose | None) -> Iterator[tuple[str, Any]]:
    robot = frames.robot
    yield f"{OWN}pose", pose_message(types, robot.map, pose)
    yield f"{OWN}odometry", odometry_message(types, robot.map, robot.base, pose, before)
    yield f"{OWN}robot", robot_scene(types, robot.map, pose)
    map_from_root = frames.map_from_root(pose.map_from_base, pose.stamp_ns)
    if map_from_root is not None:
        yield "/tf", transforms_message(types, pose.stamp_ns, (robot.map, frames.root, map_from_root))


class _Times:
    """When the pictures of a frame were taken, and when the recorder had the last of them; neither goes back."""

    def __init__(self, recording: BagRecording) -> None:
        kinds = recording.pictures
        first = next(iter(kinds))
        stamps_ns = kinds[first].stamps_ns[recording.rows[first]]
        logged_ns = np.max([kinds[kind].logged_ns[recording.rows[kind]] for kind in kinds], axis=0)
        self._stamps_ns = dict(zip(recording.numbers, stamps_ns.tolist(), strict=True))
        self._logged_ns = dict(zip(recording.numbers, np.maximum.accumulate(logged_ns).tolist(), strict=True))

    def stamp_ns(self, step: Step) -> int:
        return int(self._stamps_ns[step.frame])

    def logged_ns(self, step: Step) -> int:
        return int(self._logged_ns[step.frame])
