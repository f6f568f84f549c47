"""The cameras of a bag: rectification of left and right, and depth brought into the left picture."""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path

import numpy as np

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.bags.camera_info import camera_of, rig_of, says_rectified
from pomona.recording.bags.contents import Contents
from pomona.recording.bags.depth_registration import Registration, is_aligned
from pomona.recording.bags.frames_of_reference import bare_name, path_between
from pomona.recording.bags.topics import Roles
from pomona.recording.calibration.rectification import Optics, rectified
from pomona.recording.calibration.rig import RigCamera
from pomona.recording.calibration.rig_files import find_optics

__all__ = ["optics_of", "registration_of", "without_depth"]


def optics_of(path: Path, roles: Roles, contents: Contents, calibration: Path | None) -> Optics:
    """Rectify by what was given, else by the camera_info, else by a calibration beside the bag.

    Raises
    ------
    PomonaError
        When a camera is missing, said twice, or has no baseline.
    """
    first = next(iter(contents.pictures.values()))
    stereo, unit_m = "right" in contents.pictures, contents.depth_unit_m
    infos = (roles.left_info or roles.depth_info, roles.right_info if stereo else None)
    if calibration is not None or not any(contents.infos.get(name or "") for name in infos):
        beside = path if path.is_dir() else path.parent
        try:
            return find_optics(beside, first.size_px, stereo=stereo, given=calibration, depth_unit_m=unit_m)
        except PomonaError as error:
            if calibration is not None or "found none" not in str(error):
                raise
    left = _camera(path, contents, roles.left or roles.depth, infos[0])
    if not stereo:
        return rectified(rig_of((path,), left, None, None), first.size_px, stereo=False, depth_unit_m=unit_m)
    right = _camera(path, contents, roles.right, roles.right_info)
    right_from_left = path_between(contents.static, contents.pictures["right"].frame, first.frame)
    if right_from_left is not None and not right_from_left[:3, 3].any():
        right_from_left = None  # both pictures are said to be of one frame, as image_proc has it
    rig = rig_of((path,), left, right, right_from_left)
    return rectified(rig, first.size_px, stereo=True, depth_unit_m=unit_m)


def registration_of(path: Path, roles: Roles, contents: Contents, optics: Optics) -> Registration | None:
    """Say how depth comes into the left picture; None where it lies there as it is, or there is only one of the two.

    Raises
    ------
    PomonaError
        When depth is of another camera, and nothing says where that is.
    """
    left, depth = contents.pictures.get("left"), contents.pictures.get("depth")
    if left is None or depth is None:
        return None
    what = f"{path}: {depth.topic.name}: depth is not in the picture of {left.topic.name}"
    hint = "record it aligned, or with camera_info of both and /tf_static"
    if not (contents.infos.get(roles.left_info or "") and contents.infos.get(roles.depth_info or "")):
        if depth.size_px != left.size_px:
            sizes = " and ".join("{}x{}".format(*each.size_px) for each in (left, depth))
            raise PomonaError(f"{what}: found {sizes} pixels, expected equal sizes: {hint}")
        return None
    left_camera = _camera(path, contents, roles.left, roles.left_info)
    depth_camera = _camera(path, contents, roles.depth, roles.depth_info)
    left_from_depth = path_between(contents.static, left.frame, depth.frame)
    if is_aligned(depth_camera, left_camera, left_from_depth):
        return None
    if left_from_depth is None or bare_name(left.frame) == bare_name(depth.frame):
        raise PomonaError(f"{what}: found another camera and no transform between them: {hint}")
    rectified_from_left = np.eye(4)
    rectified_from_left[:3, :3] = optics.rectified_from_left
    return Registration.between(depth_camera, depth.size_px, optics.calibration, rectified_from_left @ left_from_depth)


def without_depth(roles: Roles, contents: Contents, reason: PomonaError) -> Roles:
    """Leave out the depth of a pair, which does not need it, and say why."""
    warnings.warn(f"{reason}; left out, as left and right are there", PomonaWarning, stacklevel=4)
    del contents.pictures["depth"]
    return dataclasses.replace(roles, depth=None, depth_info=None)


def _camera(path: Path, contents: Contents, picture: str | None, info: str | None) -> RigCamera:
    assert picture is not None
    if info is None:
        wanted = f"{picture.rpartition('/')[0]}/camera_info"
        raise PomonaError(f"{path}: {picture}: found no camera_info for it, expected {wanted} or --calibration")
    return camera_of(path, info, contents.infos[info], is_rectified=says_rectified(picture))
