"""Kalibr's camchain: `cam0`, `cam1` with `T_cn_cnm1`, the place of cam0 in cam1."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pomona.errors import PomonaError
from pomona.reading import shown
from pomona.recording.calibration.rig import Rig, RigCamera, camera_matrix
from pomona.recording.calibration.rig_files.fields import array_of, checked_size, distortion_of
from pomona.recording.calibration.rig_files.yaml_documents import read_documents

__all__ = ["pinhole", "read", "recognises"]


def recognises(fields: Mapping[str, Any]) -> bool:
    """Whether a YAML mapping is a camchain."""
    return isinstance(fields.get("cam0"), Mapping) and "intrinsics" in fields["cam0"]


def read(paths: tuple[Path, ...], _size_px: tuple[int, int]) -> Rig:
    """Read cam0 as the left camera and cam1 as the right one."""
    path = paths[0]
    chain = read_documents(path)[0]
    left = pinhole(f"{path}: cam0", chain["cam0"], "distortion_coeffs")
    if not isinstance(chain.get("cam1"), Mapping):
        return Rig((path,), left)
    right = pinhole(f"{path}: cam1", chain["cam1"], "distortion_coeffs")
    if right.fisheye != left.fisheye:
        raise PomonaError(f"{path}: found a fisheye beside another lens, expected two of one kind")
    return Rig((path,), left, right, array_of(f"{path}: cam1", chain["cam1"], "T_cn_cnm1", (4, 4)))


def pinhole(where: str, fields: Mapping[str, Any], coefficients: str) -> RigCamera:
    """Read a pinhole as Kalibr and EuRoC write it: intrinsics fx fy cx cy, distortion, resolution."""
    if fields.get("camera_model", "pinhole") != "pinhole":
        raise PomonaError(f"{where}: camera_model: found {shown(fields['camera_model'])}, expected 'pinhole'")
    fx, fy, cx, cy = array_of(where, fields, "intrinsics", (4,)).tolist()
    model = fields.get("distortion_model")
    values = array_of(where, fields, coefficients, (-1,)) if coefficients in fields else np.zeros(0)
    distortion, fisheye = distortion_of(where, model, values)
    size_px = checked_size(where, array_of(where, fields, "resolution", (2,)).tolist())
    return RigCamera(camera_matrix(fx, fy, cx, cy), distortion, fisheye, size_px)
