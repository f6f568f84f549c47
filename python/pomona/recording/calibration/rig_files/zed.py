"""The factory calibration of a ZED camera, `SN<serial>.conf`: millimetres, one section for each resolution."""

from __future__ import annotations

import configparser
from pathlib import Path

import numpy as np

from pomona.errors import PomonaError
from pomona.reading import number_in, read_text
from pomona.recording.calibration.rig import Rig, RigCamera, camera_matrix

__all__ = ["read"]

RESOLUTIONS = {
    (2208, 1242): "2K",
    (1920, 1080): "FHD",
    (1920, 1200): "FHD1200",
    (1280, 720): "HD",
    (960, 600): "SVGA",
    (672, 376): "VGA",
}
"""Size of one of the two pictures: suffix of its sections."""


def read(paths: tuple[Path, ...], size_px: tuple[int, int]) -> Rig:
    """Read the sections of the resolution that was recorded.

    The pictures are not rectified. Baseline, TY and TZ are the way from the left camera to the right one, in
    millimetres; the rotation vector (RX, CV, RZ) turns left axes into right ones.
    """
    from scipy.spatial.transform import Rotation

    path = paths[0]
    name = RESOLUTIONS.get(size_px)
    if name is None:
        expected = ", ".join(f"{width}x{height}" for width, height in RESOLUTIONS)
        raise PomonaError(f"{path}: found pictures of {size_px[0]}x{size_px[1]}, expected a ZED's: {expected}")
    sections = _sections(path)
    way_m = np.array([_number(path, sections, "STEREO", key) for key in _stereo_keys(sections, name)[:3]]) / 1000
    turn = np.array([_number(path, sections, "STEREO", key) for key in _stereo_keys(sections, name)[3:]])
    right_from_left = np.eye(4)
    right_from_left[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    # What is at the right camera lies at 0 there.
    right_from_left[:3, 3] = -way_m
    left, right = (_camera(path, sections, f"{side}_CAM_{name}", size_px) for side in ("LEFT", "RIGHT"))
    return Rig((path,), left, right, right_from_left)


def _sections(path: Path) -> configparser.ConfigParser:
    sections = configparser.ConfigParser(strict=False, interpolation=None)
    try:
        sections.read_string(read_text(path, "a calibration of a ZED"))
    except configparser.Error as error:
        raise PomonaError(f"{path}: not a calibration of a ZED ({str(error).splitlines()[0]})") from None
    return sections


def _stereo_keys(sections: configparser.ConfigParser, name: str) -> tuple[str, ...]:
    """Older cameras have one TY and TZ, newer ones one for each resolution."""
    ways = [f"{axis}_{name}" if sections.has_option("STEREO", f"{axis}_{name}") else axis for axis in ("TY", "TZ")]
    return ("Baseline", *ways, f"RX_{name}", f"CV_{name}", f"RZ_{name}")


def _camera(path: Path, sections: configparser.ConfigParser, section: str, size_px: tuple[int, int]) -> RigCamera:
    fx, fy, cx, cy = (_number(path, sections, section, key) for key in ("fx", "fy", "cx", "cy"))
    distortion = [_number(path, sections, section, key) for key in ("k1", "k2")]
    distortion += [_number(path, sections, section, key, 0.0) for key in ("p1", "p2", "k3")]
    return RigCamera(camera_matrix(fx, fy, cx, cy), np.array(distortion), size_px=size_px)


def _number(
    path: Path, sections: configparser.ConfigParser, section: str, key: str, default: float | None = None
) -> float:
    if key in ("TY", "TZ"):
        default = 0.0
    if not sections.has_option(section, key):
        if default is not None:
            return default
        raise PomonaError(f"{path}: [{section}] {key}: missing, expected a number")
    return number_in(f"{path}: [{section}]", key, sections.get(section, key))
