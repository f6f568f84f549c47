"""From camera_info messages to the cameras of a rig."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording.calibration.rig import Rig, RigCamera
from pomona.recording.calibration.rig_files.fields import distortion_of

__all__ = ["camera_of", "rig_of", "says_rectified"]


def says_rectified(topic: str) -> bool:
    """Whether pictures are rectified, by the name that image_proc gives their topic: `image_rect`."""
    return "rect" in re.split(r"[/_]", topic.lower())


def camera_of(path: Path, topic: str, messages: list[Any], *, is_rectified: bool) -> RigCamera:
    """Read the camera_info of one topic, decoded; it says the same again and again.

    Raises
    ------
    PomonaError
        When it says different things, or nothing.
    """
    where = f"{path}: {topic}"
    if not messages:
        raise PomonaError(f"{where}: found no camera_info, expected one; else give --calibration")
    said = [_Said(message) for message in messages]
    others = [each for each in said if each != said[0]]
    if others:
        raise PomonaError(f"{where}: found {len(others) + 1} camera_info that differ, expected one camera on a topic")
    info = said[0]
    if info.P[0, 0] <= 0 and info.K[0, 0] <= 0:
        raise PomonaError(f"{where}: found a camera_info of a camera that is not calibrated: its K is 0")
    projection = info.P if info.P[0, 0] > 0 else None
    rotation = info.R if info.R.any() else np.eye(3)
    if is_rectified and projection is not None:
        return RigCamera(projection[:, :3], np.zeros(0), False, info.size_px, np.eye(3), projection)
    model = "plumb_bob" if "brown conrady" in info.model.lower() else info.model
    distortion, fisheye = distortion_of(where, model, info.D) if info.D.any() else (np.zeros(0), False)
    return RigCamera(info.K, distortion, fisheye, info.size_px, rotation, projection)


class _Said:
    """What a camera_info says, whatever ROS calls its fields."""

    def __init__(self, message: Any) -> None:
        def numbers(name: str, *shape: int) -> NDArray[np.float64]:
            cells = getattr(message, name, None)
            return np.array(getattr(message, name.lower()) if cells is None else cells, np.float64).reshape(shape)

        self.K, self.R, self.P, self.D = numbers("K", 3, 3), numbers("R", 3, 3), numbers("P", 3, 4), numbers("D", -1)
        self.size_px = (int(message.width), int(message.height))
        self.model = str(message.distortion_model)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, _Said):
            return NotImplemented
        arrays = zip((self.K, self.R, self.P, self.D), (other.K, other.R, other.P, other.D), strict=True)
        same = all(np.array_equal(mine, theirs) for mine, theirs in arrays)
        return same and (self.size_px, self.model) == (other.size_px, other.model)

    __hash__ = None  # type: ignore[assignment]


def rig_of(
    paths: tuple[Path, ...], left: RigCamera, right: RigCamera | None, right_from_left: NDArray[np.float64] | None
) -> Rig:
    """Put two cameras together.

    The right one's projection has the baseline, -fx B in its last column (sensor_msgs/CameraInfo); where it has none,
    as some drivers write it, the place of the camera comes from the frames of reference.
    """
    if right is None or right.projection is None or left.projection is None:
        shifted = False
    else:
        shifted = bool(right.projection[0, 3] != left.projection[0, 3])
    if right is None or shifted or right_from_left is None:
        return Rig(paths, left, right)
    bare = [RigCamera(camera.matrix, camera.distortion, camera.fisheye, camera.size_px) for camera in (left, right)]
    return Rig(paths, bare[0], bare[1], right_from_left)
