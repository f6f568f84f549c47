"""From poses and fruits to messages of ROS 2, of whichever classes `MessageTypes` gives."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.localize import Localization
from pomona.ros.message_types import MessageTypes
from pomona.ros.robot_frames import RobotPose
from pomona.ros.stamped import header_of, plain_pose, quaternion_of, vector_of

__all__ = [
    "detections_message",
    "odometry_message",
    "path_message",
    "pose_message",
    "sightings_of",
    "transforms_message",
]

Array = NDArray[np.float64]

FRUIT = "fruit"
"""The class of all detections."""

ANY_TURN = np.pi**2 / 3
"""Variance of an angle of which nothing is known: a fruit is a sphere."""

UNKNOWN_SPEED = 1e6
"""Variance of a speed of which nothing is known, (m/s)^2 and (rad/s)^2."""


def transforms_message(types: MessageTypes, stamp_ns: int, *steps: tuple[str, str, Array]) -> Any:
    """Make a `tf2_msgs/TFMessage` of (parent, child, parent_from_child)."""
    stamped = types("geometry_msgs/msg/TransformStamped")
    made = [
        stamped(
            header=header_of(types, stamp_ns, parent),
            child_frame_id=child,
            transform=types("geometry_msgs/msg/Transform")(
                translation=vector_of(types, matrix[:3, 3]), rotation=quaternion_of(types, matrix)
            ),
        )
        for parent, child, matrix in steps
    ]
    return types("tf2_msgs/msg/TFMessage")(transforms=made)


def pose_message(types: MessageTypes, frame: str, pose: RobotPose) -> Any:
    """Make a `geometry_msgs/PoseWithCovarianceStamped` of the body in the frame of the map."""
    kind = types("geometry_msgs/msg/PoseWithCovarianceStamped")
    return kind(header=header_of(types, pose.stamp_ns, frame), pose=_uncertain(types, pose))


def odometry_message(
    types: MessageTypes, frame: str, child: str, pose: RobotPose, before: RobotPose | None = None
) -> Any:
    """Make a `nav_msgs/Odometry` of the body in the frame of the map.

    The speed is the mean one since the pose before, in the body's axes; its covariance is that of two poses whose
    errors share nothing, too large rather than too small. Where there is none before, it is `UNKNOWN_SPEED`.
    """
    speed, covariance = _speed(pose, before)
    twist = types("geometry_msgs/msg/Twist")(linear=vector_of(types, speed[:3]), angular=vector_of(types, speed[3:]))
    return types("nav_msgs/msg/Odometry")(
        header=header_of(types, pose.stamp_ns, frame),
        child_frame_id=child,
        pose=_uncertain(types, pose),
        twist=types("geometry_msgs/msg/TwistWithCovariance")(twist=twist, covariance=covariance.ravel()),
    )


def path_message(types: MessageTypes, frame: str, poses: Sequence[RobotPose]) -> Any:
    """Make a `nav_msgs/Path` of the body's way in the frame of the map, with the stamp of its last pose."""
    stamped = types("geometry_msgs/msg/PoseStamped")
    made = [
        stamped(header=header_of(types, pose.stamp_ns, frame), pose=plain_pose(types, pose.map_from_base))
        for pose in poses
    ]
    return types("nav_msgs/msg/Path")(header=header_of(types, poses[-1].stamp_ns if poses else 0, frame), poses=made)


def detections_message(
    types: MessageTypes,
    stamp_ns: int,
    frame: str,
    fruits: FruitCloud,
    known: Iterable[tuple[int, str, float]] = (),
) -> Any:
    """Make a `vision_msgs/Detection3DArray` of the fruits of one picture.

    Parameters
    ----------
    types : MessageTypes
    stamp_ns : int
        When the picture was taken.
    frame : str
        The frame that the fruits are in, for example the camera's optical one.
    fruits : FruitCloud
        With covariances and diameters where they are known.
    known : iterable of (int, str, float)
        Row of each fruit that the map knows, its id there, and the probability that it is this one: the `score` of
        the detection. The id of a fruit that the map does not know is empty, and its score 0.
    """
    told = {row: (name, chance) for row, name, chance in known}
    made = [_detection(types, stamp_ns, frame, fruits, row, *told.get(row, ("", 0.0))) for row in range(len(fruits))]
    return types("vision_msgs/msg/Detection3DArray")(header=header_of(types, stamp_ns, frame), detections=made)


def sightings_of(found: Localization, fruits: FruitCloud) -> list[tuple[int, str, float]]:
    """Give row, id and probability of each fruit of a frame that a map knows, as `detections_message` takes them.

    Parameters
    ----------
    found : Localization
        Of the frame.
    fruits : FruitCloud
        The map as the Localizer was given it; fruits without ids go by their rows.
    """
    pairs = zip(found.pairs.tolist(), found.probabilities.tolist(), strict=True)
    return [(row, str(of_map) if fruits.ids is None else fruits.ids[of_map], chance) for (row, of_map), chance in pairs]


def _detection(
    types: MessageTypes, stamp_ns: int, frame: str, fruits: FruitCloud, row: int, name: str, chance: float
) -> Any:
    covariance = np.diag([0.0] * 3 + [ANY_TURN] * 3)
    if fruits.covariances is not None:
        covariance[:3, :3] = fruits.covariances[row]
    diameter_m = 0.0 if fruits.diameters_m is None else float(np.nan_to_num(fruits.diameters_m[row]))
    place = np.eye(4)
    place[:3, 3] = fruits.positions[row]
    hypothesis = types("vision_msgs/msg/ObjectHypothesis")(class_id=FRUIT, score=float(chance))
    pose = types("geometry_msgs/msg/PoseWithCovariance")(pose=plain_pose(types, place), covariance=covariance.ravel())
    size = vector_of(types, np.full(3, diameter_m))
    return types("vision_msgs/msg/Detection3D")(
        header=header_of(types, stamp_ns, frame),
        results=[types("vision_msgs/msg/ObjectHypothesisWithPose")(hypothesis=hypothesis, pose=pose)],
        bbox=types("vision_msgs/msg/BoundingBox3D")(center=plain_pose(types, place), size=size),
        id=name,
    )


def _uncertain(types: MessageTypes, pose: RobotPose) -> Any:
    kind = types("geometry_msgs/msg/PoseWithCovariance")
    return kind(pose=plain_pose(types, pose.map_from_base), covariance=pose.fixed_axes.ravel())


def _speed(pose: RobotPose, before: RobotPose | None) -> tuple[Array, Array]:
    """Speed (6,) in the body's axes and its covariance (6, 6)."""
    from scipy.spatial.transform import Rotation

    if before is None or pose.stamp_ns <= before.stamp_ns:
        return np.zeros(6), UNKNOWN_SPEED * np.eye(6)
    seconds = (pose.stamp_ns - before.stamp_ns) / 1e9
    step = np.linalg.solve(before.map_from_base, pose.map_from_base)
    turn = Rotation.from_matrix(step[:3, :3])
    moved = turn.inv().apply(step[:3, 3])
    return np.concatenate((moved, turn.as_rotvec())) / seconds, (pose.covariance + before.covariance) / seconds**2
