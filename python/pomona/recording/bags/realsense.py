"""What RealSense's own recorder (its SDK and viewer) writes into a bag otherwise than ROS does.

Topics are `/device_0/sensor_0/Infrared_1/image/data` and the like (src/media/readme.md of librealsense). All pictures
say the same frame of reference; where the streams are to each other is on `.../Infrared_1/tf/0`, a Transform from
reference 0 to the stream. CameraInfo has no R and P. A step of depth is on `.../option/Depth Units/value`.
"""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

__all__ = ["is_depth_unit", "is_extrinsics", "static_transform", "stream_frame"]

_EXTRINSICS = re.compile(r"(?P<stream>/device_(?P<device>\d+)/sensor_\d+/\w+_\d+)/tf/(?P<reference>\d+)")
_PICTURES = re.compile(r"(?P<stream>/device_\d+/sensor_\d+/\w+_\d+)/image/data")
_DEPTH_UNIT = re.compile(r"/device_\d+/sensor_\d+/option/Depth[ _]Units/value")


def is_extrinsics(topic: str) -> bool:
    """Whether a topic tells the place of a stream."""
    return _EXTRINSICS.fullmatch(topic) is not None


def is_depth_unit(topic: str) -> bool:
    """Whether a topic tells how many metres a step of depth is."""
    return _DEPTH_UNIT.fullmatch(topic) is not None


def stream_frame(topic: str) -> str | None:
    """Give a name to the frame of reference of a topic of pictures; None for topics of other recorders."""
    found = _PICTURES.fullmatch(topic)
    return None if found is None else found["stream"]


def static_transform(topic: str, stream_from_reference: Any) -> Any:
    """Turn a decoded Transform into one of `/tf_static`: parent the stream, child the reference."""
    found = _EXTRINSICS.fullmatch(topic)
    assert found is not None
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=found["stream"]),
        child_frame_id=f"device_{found['device']}/reference_{found['reference']}",
        transform=stream_from_reference,
    )
