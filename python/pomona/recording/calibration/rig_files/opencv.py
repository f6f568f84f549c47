"""OpenCV's FileStorage YAML, as `stereo_calib` and its many descendants write it: in one file or in two."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pomona.recording.calibration.rig import Rig, RigCamera
from pomona.recording.calibration.rig_files.fields import array_of, checked_size, distortion_of, size_of
from pomona.recording.calibration.rig_files.yaml_documents import read_documents

__all__ = ["read", "recognises"]

MATRICES = {
    "left": ("M1", "K1", "cameraMatrix1", "camera_matrix_left", "left_camera_matrix"),
    "right": ("M2", "K2", "cameraMatrix2", "camera_matrix_right", "right_camera_matrix"),
    "left distortion": ("D1", "distCoeffs1", "dist_coeffs_left", "left_distortion_coefficients"),
    "right distortion": ("D2", "distCoeffs2", "dist_coeffs_right", "right_distortion_coefficients"),
    "single": ("camera_matrix", "cameraMatrix", "Camera_Matrix"),
    "single distortion": ("distortion_coefficients", "distCoeffs", "Distortion_Coefficients"),
}
"""What a matrix is: the names it goes by."""

EXTRINSICS = ("R", "T")


def recognises(fields: Mapping[str, Any]) -> bool:
    """Whether a YAML mapping has matrices of OpenCV's stereo or single calibration."""
    known = {name for names in MATRICES.values() for name in names} | {"R", "T"}
    return any(isinstance(fields.get(name), Mapping) and "data" in fields[name] for name in known)


def read(paths: tuple[Path, ...], _size_px: tuple[int, int]) -> Rig:
    """Read cameras, and R and T of `cv2.stereoCalibrate` (right_from_left); T must be in metres."""
    where = ", ".join(str(path) for path in paths)
    fields: dict[str, Any] = {}
    for path in paths:
        fields.update(read_documents(path)[0])
    size_px = _size_px_of(where, fields)
    if not any(name in fields for name in MATRICES["left"]):
        return Rig(paths, _camera(where, fields, "single", size_px))
    left, right = (_camera(where, fields, side, size_px) for side in ("left", "right"))
    right_from_left = None
    if all(name in fields for name in EXTRINSICS):
        right_from_left = np.eye(4)
        right_from_left[:3, :3] = array_of(where, fields, "R", (3, 3))
        right_from_left[:3, 3] = array_of(where, fields, "T", (3,))
    return Rig(paths, left, right, right_from_left)


def _camera(where: str, fields: Mapping[str, Any], side: str, size_px: tuple[int, int] | None) -> RigCamera:
    matrix, distortion = (
        next((name for name in MATRICES[kind] if name in fields), MATRICES[kind][0])
        for kind in (side, f"{side} distortion")
    )
    coefficients = array_of(where, fields, distortion, (-1,)) if distortion in fields else np.zeros(0)
    coefficients, _ = distortion_of(where, None, coefficients)
    return RigCamera(array_of(where, fields, matrix, (3, 3)), coefficients, size_px=size_px)


def _size_px_of(where: str, fields: Mapping[str, Any]) -> tuple[int, int] | None:
    for width, height in (("image_width", "image_height"), ("width", "height")):
        if width in fields and height in fields:
            return size_of(where, fields, width, height)
    for name in ("imageSize", "image_size", "size"):
        if name in fields:
            return checked_size(where, array_of(where, fields, name, (2,)).tolist())
    return None
