"""The small parts of messages: times, headers, points, turns, poses."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.ros.message_types import MessageTypes

__all__ = ["header_of", "plain_pose", "quaternion_of", "time_of", "vector_of"]

Array = NDArray[np.float64]


def time_of(types: MessageTypes, stamp_ns: int) -> Any:
    """Make a `builtin_interfaces/Time`."""
    seconds, nanoseconds = divmod(int(stamp_ns), 10**9)
    return types("builtin_interfaces/msg/Time")(sec=seconds, nanosec=nanoseconds)


def header_of(types: MessageTypes, stamp_ns: int, frame: str) -> Any:
    """Make a `std_msgs/Header`."""
    return types("std_msgs/msg/Header")(stamp=time_of(types, stamp_ns), frame_id=frame)


def vector_of(types: MessageTypes, numbers: Array) -> Any:
    """Make a `geometry_msgs/Vector3`."""
    return types("geometry_msgs/msg/Vector3")(**_named(numbers, "xyz"))


def quaternion_of(types: MessageTypes, matrix: Array) -> Any:
    """Make a `geometry_msgs/Quaternion` of the turn of a rigid transform; its w is never negative."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(matrix[:3, :3]).as_quat(canonical=True)
    return types("geometry_msgs/msg/Quaternion")(**_named(turn, "xyzw"))


def plain_pose(types: MessageTypes, matrix: Array) -> Any:
    """Make a `geometry_msgs/Pose` of a rigid transform."""
    position = types("geometry_msgs/msg/Point")(**_named(matrix[:3, 3], "xyz"))
    return types("geometry_msgs/msg/Pose")(position=position, orientation=quaternion_of(types, matrix))


def _named(numbers: Array, names: str) -> dict[str, float]:
    """Plain floats: the classes of rclpy take no others."""
    return dict(zip(names, np.asarray(numbers, np.float64).tolist(), strict=True))
