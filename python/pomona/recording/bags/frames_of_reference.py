"""Frames of reference that stand still against one another, as `/tf_static` tells them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.recording.poses import transforms

__all__ = ["bare_name", "matrix_of", "path_between"]


def bare_name(frame: str) -> str:
    """Name of a frame without the slash that ROS 1 once put before it."""
    return frame.lstrip("/")


def matrix_of(translation: Any, rotation: Any) -> NDArray[np.float64]:
    """Rigid transform (4, 4) of a decoded Vector3 or Point and a Quaternion; the identity for a quaternion of zeros."""
    quaternion = np.array([[rotation.x, rotation.y, rotation.z, rotation.w]], np.float64)
    if not quaternion.any():
        quaternion[0, 3] = 1.0
    position = np.array([[translation.x, translation.y, translation.z]], np.float64)
    return np.asarray(transforms(quaternion, position)[0])


def path_between(stamped: Iterable[Any], target: str, source: str) -> NDArray[np.float64] | None:
    """Give target_from_source (4, 4) along decoded `TransformStamped`, None where they do not lead there."""
    steps: dict[str, dict[str, NDArray[np.float64]]] = {}
    for each in stamped:
        parent, child = bare_name(each.header.frame_id), bare_name(each.child_frame_id)
        parent_from_child = matrix_of(each.transform.translation, each.transform.rotation)
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
