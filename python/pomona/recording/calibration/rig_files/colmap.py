"""COLMAP's `cameras.txt`, and since version 4 `rigs.txt` with the place of the second camera."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import number_in, read_text, shown
from pomona.recording.calibration.rig import Rig, RigCamera, camera_matrix
from pomona.recording.picture_size import require_size
from pomona.recording.poses import transforms

__all__ = ["read"]

MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
}
"""Camera model: its parameters in the file's order."""


def read(paths: tuple[Path, ...], _size_px: tuple[int, int]) -> Rig:
    """Read one camera, or the two of a rig; the reference sensor of the rig is the left one.

    A model is metric only where its rig was given in metres: COLMAP itself knows no scale.
    """
    path = paths[0]
    cameras = {words[0]: _camera(where, words) for where, words in _lines(path)}
    rigs = path.with_name("rigs.txt")
    if len(cameras) == 1:
        return Rig((path,), next(iter(cameras.values())))
    if not rigs.is_file():
        found = f"{len(cameras)} cameras without rigs.txt"
        raise PomonaError(f"{path}: no baseline: found {found}, expected rigs.txt with the place of the right one")
    where, words = next(_lines(rigs), (str(rigs), []))
    # RIG_ID NUM_SENSORS REF_TYPE REF_ID, then TYPE ID HAS_POSE QW QX QY QZ TX TY TZ
    if len(words) != 14 or words[1] != "2" or words[6] != "1" or not {words[3], words[5]} <= cameras.keys():
        raise PomonaError(f"{where}: found {shown(' '.join(words))}, expected a rig of two cameras with one pose")
    return Rig((path, rigs), cameras[words[3]], cameras[words[5]], _pose(where, words[7:]))


def _lines(path: Path) -> Iterator[tuple[str, list[str]]]:
    text = read_text(path, "cameras of COLMAP")
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.startswith("#"):
            yield f"{path}: line {number}", line.split()


def _camera(where: str, words: list[str]) -> RigCamera:
    model = words[1] if len(words) > 1 else "nothing"
    if model not in MODELS:
        raise PomonaError(f"{where}: found the camera model {shown(model)}, expected one of {', '.join(MODELS)}")
    names = MODELS[model]
    numbers = [number_in(where, "camera", word) for word in words[2:]]
    if len(numbers) != 2 + len(names):
        raise PomonaError(f"{where}: found {len(numbers)} numbers, expected width height {' '.join(names)}")
    value = dict(zip(names, numbers[2:], strict=True))
    fx, fy = value.get("fx", value.get("f", 0.0)), value.get("fy", value.get("f", 0.0))
    fisheye = model == "OPENCV_FISHEYE"
    kept = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2")
    distortion = np.array([value.get(name, 0.0) for name in kept]) if "k1" in value else np.zeros(0)
    # COLMAP counts from the corner of the first pixel, as we do; a RigCamera counts from its centre.
    matrix = camera_matrix(fx, fy, value["cx"] - 0.5, value["cy"] - 0.5)
    return RigCamera(matrix, distortion, fisheye, require_size(where, (int(numbers[0]), int(numbers[1]))))


def _pose(where: str, words: list[str]) -> NDArray[np.float64]:
    w, x, y, z, *translation = [number_in(where, "pose", word) for word in words]
    if not abs(np.linalg.norm([w, x, y, z]) - 1) < 1e-2:
        raise PomonaError(f"{where}: found a quaternion that is not of length 1, expected qw qx qy qz")
    pose: NDArray[np.float64] = transforms(np.array([[x, y, z, w]]), np.array([translation]))[0]
    return pose
