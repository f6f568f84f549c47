"""Picture files: colour as BGR bytes, depth as metres."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import path_inside, require_file, whole_number
from pomona.recording.calibration import Calibration
from pomona.recording.picture_size import encoded_size, require_size

__all__ = [
    "PICTURE_SUFFIXES",
    "UnreadablePictureError",
    "decoded_picture",
    "numbered_pictures",
    "picture_inside",
    "picture_size",
    "read_colour",
    "read_depth",
    "read_numbers",
]

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg")

MOST_ENCODED_BYTES = 1 << 29
"""512 MiB: `MOST_PIXELS` of four channels of 16 bits, not compressed."""

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
        number = whole_number(str(file), file.stem, "a frame number")
        if number in found:
            raise PomonaError(f"{file}: frame {number} is there twice, also as {found[number].name}")
        found[number] = _no_special(file)
    return dict(sorted(found.items()))


def picture_inside(where: str, folder: Path, name: str) -> Path:
    """Give the file of a picture that a list names; one that is not there costs its frame, later.

    Raises
    ------
    PomonaError
        One line that begins with `where`: the name leads out of the folder, or to a pipe or a device.
    """
    return _no_special(path_inside(where, folder, name))


def _no_special(file: Path) -> Path:
    if file.exists():
        require_file(file, "a picture")
    return file


def picture_size(path: Path) -> tuple[int, int]:
    """Width and height of a picture file."""
    import cv2

    height, width = _decode(path, cv2.IMREAD_UNCHANGED).shape[:2]
    return width, height


def read_colour(path: Path, calibration: Calibration) -> NDArray[np.uint8]:
    """Read a colour picture as (H, W, 3) uint8, BGR."""
    import cv2

    picture = _decode(path, cv2.IMREAD_COLOR, calibration.size_px)
    _require_size(path, picture, calibration)
    return np.asarray(picture, np.uint8)


def read_depth(path: Path, calibration: Calibration) -> NDArray[np.float32]:
    """Read a 16-bit depth picture as (H, W) float32 metres along the optical axis, 0 where nothing was measured."""
    import cv2

    picture = _decode(path, cv2.IMREAD_UNCHANGED, calibration.size_px)
    channels = 1 if picture.ndim == 2 else picture.shape[2]
    if channels != 1:
        raise PomonaError(f"{path}: found {channels} channels, expected one: depth, 16 bit")
    if picture.dtype != np.uint16:
        bits = picture.dtype.itemsize * 8
        raise PomonaError(f"{path}: found {bits}-bit pixels, expected 16 bit: depth in {calibration.depth_unit_m:g} m")
    _require_size(path, picture, calibration)
    return picture.astype(np.float32) * np.float32(calibration.depth_unit_m)


def read_numbers(path: Path, calibration: Calibration) -> NDArray[np.uint8 | np.uint16]:
    """Read a picture of one channel whose pixels are numbers, (H, W), of 8 or 16 bits."""
    import cv2

    picture = _decode(path, cv2.IMREAD_UNCHANGED, calibration.size_px)
    if picture.ndim != 2 or picture.dtype not in (np.uint8, np.uint16):
        bits, channels = 8 * picture.dtype.itemsize, 1 if picture.ndim == 2 else picture.shape[2]
        raise UnreadablePictureError(f"{path}: found {channels} channels of {bits} bits, expected one of 8 or 16 bits")
    _require_size(path, picture, calibration)
    return picture


def decoded_picture(
    where: str | Path,
    encoded: NDArray[np.uint8],
    flags: int,
    size_px: tuple[int, int] | None = None,
    size_of: str = "in the calibration",
) -> NDArray[Any]:
    """Decode the bytes of a picture as `cv2.imdecode` does, but not one that is cut off or of a wrong size.

    Parameters
    ----------
    where : str or Path
        For messages.
    encoded : (N,) uint8
        PNG or JPEG, or another kind whose size `encoded_size` can tell.
    flags : int
        Of OpenCV.
    size_px : (width, height), optional
        What it must be, told from the header, before memory is taken; else anything that somebody records.
    size_of : str
        Where that size is from, for messages.

    Raises
    ------
    UnreadablePictureError
        One line that begins with `where`.
    """
    import cv2

    content = encoded.tobytes()
    damage = _damage(content)
    if damage is not None:
        raise UnreadablePictureError(f"{where}: {damage}")
    found_px = encoded_size(content)
    if found_px is not None:
        _require_decodable(where, found_px, size_px, size_of)
    try:
        picture = cv2.imdecode(encoded, flags) if found_px is not None else None
    except cv2.error:
        picture = None
    if picture is None:
        raise UnreadablePictureError(f"{where}: not a picture, or a corrupt one")
    return np.asarray(picture)


def _require_decodable(
    where: str | Path, found_px: tuple[int, int], size_px: tuple[int, int] | None, size_of: str
) -> None:
    # A picture may be turned by what its camera noted, so width and height may change places.
    if size_px is not None and sorted(found_px) != sorted(size_px):
        found, expected = ("{}x{}".format(*each) for each in (found_px, size_px))
        raise UnreadablePictureError(f"{where}: found {found} pixels, expected {expected} as {size_of}")
    try:
        require_size(str(where), found_px)
    except PomonaError as error:
        raise UnreadablePictureError(str(error)) from None


def _decode(path: Path, flags: int, size_px: tuple[int, int] | None = None) -> NDArray[Any]:
    try:
        if require_file(path, "a picture") > MOST_ENCODED_BYTES:
            raise PomonaError(f"{path}: found more than {MOST_ENCODED_BYTES >> 20} MiB, expected a picture")
        encoded = np.fromfile(path, np.uint8)
    except PomonaError as error:
        raise UnreadablePictureError(str(error)) from None
    except OSError as error:
        raise UnreadablePictureError(f"{path}: cannot be read: {error.strerror}") from None
    if path.suffix.lower() == ".png" and encoded[:8].tobytes() != PNG_BEGINS:
        raise UnreadablePictureError(f"{path}: the PNG is cut off or not a PNG")
    return decoded_picture(path, encoded, flags, size_px)


def _damage(encoded: bytes) -> str | None:
    """Say what is wrong with a PNG or JPEG where decoders fill in zeros or grey, and only mutter on stderr."""
    if encoded.startswith(PNG_BEGINS):
        if b"IEND" not in encoded[-32:]:
            return "the PNG is cut off"
        return None if _checksums_are_right(encoded) else "the PNG is damaged: a checksum is wrong"
    if encoded.startswith(b"\xff\xd8"):
        # The end of the image must come after the last start of a scan; thumbnails have ends of their own before it.
        end = encoded.rfind(b"\xff\xd9")
        return "the JPEG is cut off" if end < 0 or encoded.find(b"\xff\xda", end) >= 0 else None
    return None


def _checksums_are_right(png: bytes) -> bool:
    """Tell whether each chunk (length, name, content, CRC-32 of name and content) is as it was written."""
    view, at = memoryview(png), len(PNG_BEGINS)
    while at + 12 <= len(png):
        end = at + 8 + int.from_bytes(view[at : at + 4])
        if zlib.crc32(view[at + 4 : end]) != int.from_bytes(view[end : end + 4]):
            return False
        if png[at + 4 : at + 8] == b"IEND":
            return True
        at = end + 4
    return False


def _require_size(path: Path, picture: NDArray[Any], calibration: Calibration) -> None:
    height, width = picture.shape[:2]
    if (width, height) != calibration.size_px:
        expected = f"{calibration.width}x{calibration.height} as in the calibration"
        raise UnreadablePictureError(f"{path}: found {width}x{height} pixels, expected {expected}")
