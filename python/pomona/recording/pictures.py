"""Picture files: colour as BGR bytes, depth as metres."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording.calibration import Calibration

__all__ = [
    "UnreadablePictureError",
    "decoded_picture",
    "numbered_pictures",
    "picture_size",
    "read_colour",
    "read_depth",
]

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg")

PNG_BEGINS = b"\x89PNG\r\n\x1a\n"


class UnreadablePictureError(PomonaError):
    """One picture is missing, cut off, corrupt or of another size; the rest of the recording may be well."""


def numbered_pictures(folder: Path) -> dict[int, Path]:
    """Map frame numbers to picture files in ascending order; names are numbers, as 0007.png."""
    found: dict[int, Path] = {}
    for file in sorted(folder.iterdir()):
        if file.name.startswith(".") or file.suffix.lower() not in PICTURE_SUFFIXES:
            continue
        if not (file.stem.isascii() and file.stem.isdecimal()):
            raise PomonaError(f"{file}: found the name {file.stem!r}, expected a frame number, for example 0007.png")
        if int(file.stem) in found:
            raise PomonaError(f"{file}: frame {int(file.stem)} is there twice, also as {found[int(file.stem)].name}")
        found[int(file.stem)] = file
    return dict(sorted(found.items()))


def picture_size(path: Path) -> tuple[int, int]:
    """Width and height of a picture file."""
    import cv2

    height, width = _decode(path, cv2.IMREAD_UNCHANGED).shape[:2]
    return width, height


def read_colour(path: Path, calibration: Calibration) -> NDArray[np.uint8]:
    """Read a colour picture as (H, W, 3) uint8, BGR."""
    import cv2

    picture = _decode(path, cv2.IMREAD_COLOR)
    _require_size(path, picture, calibration)
    return np.asarray(picture, np.uint8)


def read_depth(path: Path, calibration: Calibration) -> NDArray[np.float32]:
    """Read a 16-bit depth picture as (H, W) float32 metres along the optical axis, 0 where nothing was measured."""
    import cv2

    picture = _decode(path, cv2.IMREAD_UNCHANGED)
    channels = 1 if picture.ndim == 2 else picture.shape[2]
    if channels != 1:
        raise PomonaError(f"{path}: found {channels} channels, expected one: depth, 16 bit")
    if picture.dtype != np.uint16:
        bits = picture.dtype.itemsize * 8
        raise PomonaError(f"{path}: found {bits}-bit pixels, expected 16 bit: depth in {calibration.depth_unit_m:g} m")
    _require_size(path, picture, calibration)
    return picture.astype(np.float32) * np.float32(calibration.depth_unit_m)


def decoded_picture(where: str | Path, encoded: NDArray[np.uint8], flags: int) -> NDArray[Any]:
    """Decode the bytes of a PNG or JPEG as `cv2.imdecode` does, but not one that is cut off.

    Raises
    ------
    UnreadablePictureError
        One line that begins with `where`.
    """
    import cv2

    kind = _cut_off(encoded.tobytes())
    if kind is not None:
        raise UnreadablePictureError(f"{where}: the {kind} is cut off")
    picture = cv2.imdecode(encoded, flags) if len(encoded) else None
    if picture is None:
        raise UnreadablePictureError(f"{where}: not a picture, or a corrupt one")
    return np.asarray(picture)


def _decode(path: Path, flags: int) -> NDArray[Any]:
    try:
        encoded = np.fromfile(path, np.uint8)
    except OSError as error:
        raise UnreadablePictureError(f"{path}: cannot be read: {error.strerror}") from None
    if path.suffix.lower() == ".png" and encoded[:8].tobytes() != PNG_BEGINS:
        raise UnreadablePictureError(f"{path}: the PNG is cut off or not a PNG")
    return decoded_picture(path, encoded, flags)


def _cut_off(encoded: bytes) -> str | None:
    """Name a PNG or JPEG that has no end: decoders fill the rest with zeros or grey, and only mutter on stderr."""
    if encoded.startswith(PNG_BEGINS):
        return None if b"IEND" in encoded[-32:] else "PNG"
    if encoded.startswith(b"\xff\xd8"):
        # The end of the image must come after the last start of a scan; thumbnails have ends of their own before it.
        return None if encoded.rfind(b"\xff\xd9") > encoded.rfind(b"\xff\xda") else "JPEG"
    return None


def _require_size(path: Path, picture: NDArray[Any], calibration: Calibration) -> None:
    height, width = picture.shape[:2]
    if (width, height) != calibration.size_px:
        expected = f"{calibration.width}x{calibration.height} as in the calibration"
        raise UnreadablePictureError(f"{path}: found {width}x{height} pixels, expected {expected}")
