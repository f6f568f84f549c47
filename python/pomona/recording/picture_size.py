"""Width and height of a picture before it is decoded: a decoder takes memory for them first, whatever its bytes."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator

from pomona.errors import PomonaError

__all__ = ["MOST_PIXELS", "encoded_size", "require_size"]

MOST_PIXELS = 1 << 26
"""67 million, 8192 x 8192: twice what stereo cameras have, and half a gigabyte in four channels of 16 bits."""

MOST_SIDE_PX = 32_766
"""Longest side that OpenCV can rectify."""

START_OF_SCAN = 0xDA
STARTS_OF_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
ALONE = frozenset({0x00, 0x01, *range(0xD0, 0xD9)})
"""Markers of a JPEG; those that stand alone have no length after them."""

Size = tuple[int, int]


def require_size(where: str, size_px: Size) -> Size:
    """Give width and height back, unless they are none or more than anybody records.

    Raises
    ------
    PomonaError
        One line that begins with `where`.
    """
    width, height = size_px
    if not (1 <= width <= MOST_SIDE_PX and 1 <= height <= MOST_SIDE_PX and width * height <= MOST_PIXELS):
        expected = f"at least 1x1 and at most {MOST_PIXELS >> 20} million pixels"
        raise PomonaError(f"{where}: found a size of {width}x{height}, expected {expected}")
    return size_px


def encoded_size(encoded: bytes) -> Size | None:
    """Width and height by the header of a PNG, JPEG, TIFF, WebP, BMP or PNM, None where it is none of them."""
    for begins, size in _KINDS:
        if re.match(begins, encoded, re.DOTALL):
            try:
                return size(encoded)
            except (struct.error, IndexError):
                return None
    return None


def _png(encoded: bytes) -> Size | None:
    width, height = struct.unpack_from(">II", encoded, 16)
    return (width, height) if encoded[12:16] == b"IHDR" else None


def _jpeg(encoded: bytes) -> Size | None:
    """Walk over the segments to the start of frame (ITU-T T.81, B.1.1); previews lie inside of segments."""
    at = encoded.find(b"\xff", 2)  # decoders pass over what is no marker too
    while at >= 0 and (marker := encoded[at + 1]) != START_OF_SCAN:
        if marker in STARTS_OF_FRAME:
            height, width = struct.unpack_from(">HH", encoded, at + 5)
            return width, height
        if marker == 0xFF:
            length = 1
        elif marker in ALONE:
            length = 2
        else:
            length = 2 + struct.unpack_from(">H", encoded, at + 2)[0]
        at = encoded.find(b"\xff", at + length)
    return None


def _tiff(encoded: bytes) -> Size | None:
    """Take the largest of what the first directory says (TIFF 6.0, section 2; also BigTIFF's)."""
    order = "<" if encoded.startswith(b"II") else ">"
    big = struct.unpack_from(f"{order}H", encoded, 2)[0] == 43
    (at,) = struct.unpack_from(f"{order}Q" if big else f"{order}I", encoded, 8 if big else 4)
    (count,) = struct.unpack_from(f"{order}Q" if big else f"{order}H", encoded, at)
    at, step, inside = (at + 8, 20, 12) if big else (at + 2, 12, 8)
    sides = {256: 0, 257: 0}
    for entry in range(at, min(at + step * count, len(encoded)), step):
        tag, kind = struct.unpack_from(f"{order}HH", encoded, entry)
        number = {3: "H", 4: "I", 16: "Q"}.get(kind)
        if tag in sides and number is not None:
            sides[tag] = max(sides[tag], *struct.unpack_from(f"{order}{number}", encoded, entry + inside))
    return sides[256], sides[257]


def _webp(encoded: bytes) -> Size | None:
    """Canvas, lossless or lossy frame (RFC 9649, 2.5 to 2.7)."""
    kind = encoded[12:16]
    if kind == b"VP8X":
        return 1 + int.from_bytes(encoded[24:27], "little"), 1 + int.from_bytes(encoded[27:30], "little")
    if kind == b"VP8L":
        bits = int.from_bytes(encoded[21:25], "little")
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    if kind == b"VP8 ":
        width, height = struct.unpack_from("<HH", encoded, 26)
        return width & 0x3FFF, height & 0x3FFF
    return None


def _bmp(encoded: bytes) -> Size | None:
    if int.from_bytes(encoded[14:18], "little") == 12:
        width, height = struct.unpack_from("<HH", encoded, 18)
    else:
        width, height = struct.unpack_from("<ii", encoded, 18)
    return width, abs(height)  # rows from the top down are a negative height


def _pnm(encoded: bytes) -> Size | None:
    numbers: Iterator[bytes] = (found[1] for found in re.finditer(rb"(?:\s|#[^\n]*\n)+(\d{1,9})", encoded[2:1000]))
    width, height = next(numbers, None), next(numbers, None)
    return None if width is None or height is None else (int(width), int(height))


_KINDS: tuple[tuple[bytes, Callable[[bytes], Size | None]], ...] = (
    (rb"\x89PNG\r\n\x1a\n", _png),
    (rb"\xff\xd8", _jpeg),
    (rb"II[\x2a\x2b]\0|MM\0[\x2a\x2b]", _tiff),
    (rb"RIFF....WEBP", _webp),
    (rb"BM", _bmp),
    (rb"P[1-6]\s", _pnm),
)
