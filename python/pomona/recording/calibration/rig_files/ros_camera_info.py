"""ROS `camera_info` as YAML: from `camera_calibration` or `ros2 topic echo`; one file a camera."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pomona.errors import PomonaError
from pomona.recording.calibration.rig import Rig, RigCamera
from pomona.recording.calibration.rig_files.fields import array_of, distortion_of, size_of
from pomona.recording.calibration.rig_files.yaml_documents import read_documents

__all__ = ["read", "recognises"]

NAMES = {
    "K": ("camera_matrix", "K", "k"),
    "D": ("distortion_coefficients", "D", "d"),
    "R": ("rectification_matrix", "R", "r"),
    "P": ("projection_matrix", "P", "p"),
    "width": ("image_width", "width"),
    "height": ("image_height", "height"),
}
"""Field of the message: its names in the file of the calibration tool, in ROS 1 and in ROS 2."""


def recognises(fields: Mapping[str, Any]) -> bool:
    """Whether a YAML mapping is a camera_info."""
    return "distortion_model" in fields and all(any(name in fields for name in NAMES[key]) for key in ("K", "P"))


def read(paths: tuple[Path, ...], _size_px: tuple[int, int]) -> Rig:
    """Read one camera_info, or two: the right one is that whose projection has a shift.

    Raises
    ------
    PomonaError
        When there are more than two, or two left or two right ones.
    """
    cameras = {path: _camera(path) for path in paths}
    shifted = [path for path, camera in cameras.items() if camera.projection is not None and camera.projection[0, 3]]
    plain = [path for path in paths if path not in shifted]
    if len(plain) != 1 or len(shifted) > 1:
        side, found = ("left", plain) if len(plain) != 1 else ("right", shifted)
        names = ", ".join(path.name for path in found) or "none"
        raise PomonaError(
            f"{paths[0].parent}: found {len(found)} camera_info of a {side} camera ({names}), expected one; "
            "the right one has -fx * baseline in projection_matrix"
        )
    right = cameras[shifted[0]] if shifted else None
    return Rig(paths=(*plain, *shifted), left=cameras[plain[0]], right=right)


def _camera(path: Path) -> RigCamera:
    messages = read_documents(path)
    # A topic that was printed for a while says the same again and again, apart from its header.
    said = [{name: value for name, value in message.items() if name != "header"} for message in messages]
    if any(message != said[0] for message in said):
        raise PomonaError(f"{path}: found {len(said)} camera_info that differ, expected one camera in a file")
    fields = {key: said[0].get(next((name for name in names if name in said[0]), "")) for key, names in NAMES.items()}
    where = str(path)
    distortion, fisheye = distortion_of(
        where, said[0]["distortion_model"] or None, array_of(where, {**fields, "D": fields["D"] or []}, "D", (-1,))
    )
    return RigCamera(
        matrix=array_of(where, fields, "K", (3, 3)),
        distortion=distortion,
        fisheye=fisheye,
        size_px=size_of(where, fields, "width", "height"),
        rotation=array_of(where, fields, "R", (3, 3)),
        projection=array_of(where, fields, "P", (3, 4)),
    )
