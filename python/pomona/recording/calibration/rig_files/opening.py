"""From a folder or a file to the calibration in it; each kind is imported when it is met."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from pomona.errors import PomonaError
from pomona.recording.calibration.pinhole import Calibration
from pomona.recording.calibration.rectification import Optics, rectified
from pomona.recording.calibration.rig import Rig

__all__ = ["find_optics"]

ACCEPTED = (
    "calibration.json, ROS camera_info YAML (left and right), Kalibr camchain YAML, OpenCV YAML, COLMAP cameras.txt, "
    "ZED SN*.conf"
)
"""For messages and the documentation."""

YAML_KINDS = ("ros_camera_info", "kalibr", "opencv")
MAY_BE_SEVERAL_FILES = ("ros_camera_info", "opencv")


def find_optics(
    place: Path, size_px: tuple[int, int], *, stereo: bool, given: Path | None = None, depth_unit_m: float = 0.001
) -> Optics:
    """Find and read the one calibration in a folder, or the one that was given, and rectify it.

    Parameters
    ----------
    place : Path
        Folder of the recording.
    size_px : (width, height)
        Of one recorded picture.
    stereo : bool
        Whether there is a right picture; then there must be a baseline.
    given : Path, optional
        File or folder to take instead.
    depth_unit_m : float
        For depth pictures, where the calibration does not say it.

    Raises
    ------
    PomonaError
        When there is none, or more than one.
    """
    kinds = _kinds(given or place)
    if len(kinds) != 1:
        found = "; ".join(", ".join(path.name for path in paths) for paths in kinds.values()) or "none"
        hint = ": choose one with --calibration" if kinds else ""
        raise PomonaError(f"{given or place}: calibration: found {found}, expected one of {ACCEPTED}{hint}")
    ((kind, paths),) = kinds.items()
    if kind == "json":
        return _ours(paths[0], size_px, stereo, depth_unit_m)
    rig: Rig = importlib.import_module(f"pomona.recording.calibration.rig_files.{kind}").read(paths, size_px)
    return rectified(rig, size_px, stereo=stereo, depth_unit_m=depth_unit_m)


def _kinds(place: Path) -> dict[str, tuple[Path, ...]]:
    if not place.exists():
        raise PomonaError(f"{place}: not found, expected a calibration: {ACCEPTED}")
    kinds: dict[str, tuple[Path, ...]] = {}
    for path in sorted(place.iterdir()) if place.is_dir() else [place]:
        kind = _kind(path, chosen=path == place)
        if kind is not None:
            kinds[kind] = (*kinds.get(kind, ()), path)
    for kind, paths in kinds.items():
        if len(paths) > 1 and kind not in MAY_BE_SEVERAL_FILES:
            names = ", ".join(path.name for path in paths)
            raise PomonaError(f"{place}: calibration: found {names}, expected one: choose it with --calibration")
    return kinds


def _kind(path: Path, chosen: bool) -> str | None:
    suffix = path.suffix.lower()
    if not path.is_file():
        return None
    if path.name == "calibration.json" or (chosen and suffix == ".json"):
        return "json"
    if path.name == "cameras.txt":
        return "colmap"
    if suffix == ".conf":
        return "zed"
    if suffix in (".yaml", ".yml"):
        return _yaml_kind(path)
    return None


def _yaml_kind(path: Path) -> str | None:
    from pomona.recording.calibration.rig_files.yaml_documents import read_documents

    fields: dict[str, Any] = read_documents(path)[0]
    modules = ((kind, importlib.import_module(f"pomona.recording.calibration.rig_files.{kind}")) for kind in YAML_KINDS)
    return next((kind for kind, module in modules if module.recognises(fields)), None)


def _ours(path: Path, size_px: tuple[int, int], stereo: bool, depth_unit_m: float) -> Optics:
    calibration = Calibration.read(path, depth_unit_m=depth_unit_m)
    if calibration.size_px != size_px:
        found = f"{calibration.width}x{calibration.height}"
        raise PomonaError(
            f"{path}: found a calibration for {found}, expected {size_px[0]}x{size_px[1]} as pictures are"
        )
    if stereo and calibration.baseline_m is None:
        raise PomonaError(f"{path}: baseline_m: missing, expected metres: there are left and right pictures")
    return Optics.of(calibration, path)
