"""Frames of reference that stand still against one another, as `/tf_static` tells them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pomona.reading import MOST_NUMBER
from pomona.recording.poses import transforms

__all__ = ["Joint", "bare_name", "joint_of", "matrix_of", "path_between"]

LEAST_TURN = 1e-3
"""Largest number of a quaternion that says something: one that is written has length 1."""


def bare_name(frame: str) -> str:
    """Name of a frame without the slash that ROS 1 once put before it."""
    return frame.lstrip("/")


class Joint(NamedTuple):
    """One frame in another."""

    parent: str
    child: str
    parent_from_child: NDArray[np.float64]


def joint_of(stamped: Any) -> Joint | None:
    """Take a decoded `TransformStamped` as tf2 does; None where a frame is nameless or in itself, or no number is."""
    parent, child = bare_name(str(stamped.header.frame_id)), bare_name(str(stamped.child_frame_id))
    matrix = matrix_of(stamped.transform.translation, stamped.transform.rotation)
    return None if matrix is None or not parent or not child or parent == child else Joint(parent, child, matrix)


def matrix_of(translation: Any, rotation: Any) -> NDArray[np.float64] | None:
    """Rigid transform (4, 4) of a decoded Vector3 or Point and a Quaternion; the identity for a quaternion of zeros.

    None where a number is none, as odometry says it that has lost its way.
    """
    quaternion = np.array([[rotation.x, rotation.y, rotation.z, rotation.w]], np.float64)
    position = np.array([[translation.x, translation.y, translation.z]], np.float64)
    if not quaternion.any():
        quaternion[0, 3] = 1.0
    largest = float(np.abs(quaternion).max())
    if not (LEAST_TURN <= largest <= MOST_NUMBER and np.abs(position).max() <= MOST_NUMBER):  # nor is what is NaN
        return None
    return np.asarray(transforms(quaternion, position)[0])


def path_between(stamped: Iterable[Any], target: str, source: str) -> NDArray[np.float64] | None:
    """Give target_from_source (4, 4) along decoded `TransformStamped`, None where they do not lead there."""
    steps: dict[str, dict[str, NDArray[np.float64]]] = {}
    for parent, child, parent_from_child in filter(None, map(joint_of, stamped)):
        steps.setdefault(parent, {})[child] = parent_from_child
        steps.setdefault(child, {})[parent] = np.asarray(np.linalg.inv(parent_from_child), np.float64)
    target, source = bare_name(target), bare_name(source)
    if not (target and source):
        return None
    reached = {target: np.eye(4)}
    waiting = deque([target])
    while waiting and source not in reached:
        here = waiting.popleft()
        for there, here_from_there in steps.get(here, {}).items():
            if there not in reached:
                reached[there] = reached[here] @ here_from_there
                waiting.append(there)
    return reached.get(source)
