"""From an image message to a picture: BGR bytes, or depth in metres."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording.picture_size import require_size
from pomona.recording.pictures import UnreadablePictureError, decoded_picture

__all__ = ["ENCODINGS", "colour_of", "depth_of", "is_depth", "size_of"]

RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"

ENCODINGS: dict[str, tuple[str, int, str | None]] = {
    "mono8": ("u1", 1, "COLOR_GRAY2BGR"),
    "8UC1": ("u1", 1, "COLOR_GRAY2BGR"),
    "bgr8": ("u1", 3, None),
    "8UC3": ("u1", 3, None),
    "rgb8": ("u1", 3, "COLOR_RGB2BGR"),
    "bgra8": ("u1", 4, "COLOR_BGRA2BGR"),
    "8UC4": ("u1", 4, "COLOR_BGRA2BGR"),
    "rgba8": ("u1", 4, "COLOR_RGBA2BGR"),
    # OpenCV names a pattern by its second row and column, ROS by its first.
    "bayer_rggb8": ("u1", 1, "COLOR_BayerBG2BGR"),
    "bayer_bggr8": ("u1", 1, "COLOR_BayerRG2BGR"),
    "bayer_gbrg8": ("u1", 1, "COLOR_BayerGR2BGR"),
    "bayer_grbg8": ("u1", 1, "COLOR_BayerGB2BGR"),
    "yuv422": ("u1", 2, "COLOR_YUV2BGR_UYVY"),
    "uyvy": ("u1", 2, "COLOR_YUV2BGR_UYVY"),
    "yuv422_yuy2": ("u1", 2, "COLOR_YUV2BGR_YUY2"),
    "yuyv": ("u1", 2, "COLOR_YUV2BGR_YUY2"),
    "mono16": ("u2", 1, None),
    "16UC1": ("u2", 1, None),
    "32FC1": ("f4", 1, None),
}
"""Encoding: type of a number, numbers a pixel, conversion of OpenCV into BGR."""

DEPTH_ENCODINGS = ("16UC1", "mono16", "32FC1")

FIRST = "the first one"

DEPTH_HEAD = struct.Struct("<i2f")
"""`compressedDepth` begins with a format, and A and B of the inverse depth p: z = A / (p - B)."""


def is_depth(message: Any) -> bool:
    """Whether a decoded image message holds depth."""
    if hasattr(message, "encoding"):
        return message.encoding in DEPTH_ENCODINGS
    return "compressedDepth" in message.format


def size_of(where: str, message: Any) -> tuple[int, int]:
    """Width and height."""
    if hasattr(message, "encoding"):
        _pixels(where, message)
        return require_size(where, (int(message.width), int(message.height)))
    picture = _depth_codes(where, message) if is_depth(message) else _decompressed(where, message)
    return picture.shape[1], picture.shape[0]


def colour_of(where: str, message: Any, size_px: tuple[int, int]) -> NDArray[np.uint8]:
    """Give (H, W, 3) uint8, BGR; grey pictures three times the same.

    Raises
    ------
    UnreadablePictureError
        When the picture is corrupt or of another size than the first one.
    """
    import cv2

    if not hasattr(message, "encoding"):
        picture = _decompressed(where, message, size_px)
    else:
        pixels = _pixels(where, message)
        conversion = ENCODINGS[message.encoding][2]
        if pixels.dtype.kind == "f":
            raise PomonaError(f"{where}: found {message.encoding}, expected colour or grey")
        if pixels.dtype.itemsize == 2:  # 10 or 12 bits are written into 16 from above
            pixels, conversion = (pixels >> 8).astype(np.uint8), "COLOR_GRAY2BGR"
        picture = pixels if conversion is None else cv2.cvtColor(pixels, getattr(cv2, conversion))
    _require_size(where, picture, size_px)
    return np.asarray(picture, np.uint8)


def depth_of(where: str, message: Any, size_px: tuple[int, int], unit_m: float) -> NDArray[np.float32]:
    """Give (H, W) float32 metres, 0 where nothing was measured.

    Whole numbers are steps of `unit_m` (ROS: millimetres), floats are metres (REP 118).
    """
    codes = _pixels(where, message) if hasattr(message, "encoding") else _depth_codes(where, message, size_px)
    if codes.ndim != 2 or codes.dtype.itemsize == 1:
        found = getattr(message, "encoding", None) or message.format
        raise PomonaError(f"{where}: found {found!r}, expected depth: 16UC1 or 32FC1")
    _require_size(where, codes, size_px)
    if codes.dtype.kind == "u":
        return codes.astype(np.float32) * np.float32(unit_m)
    return np.where(np.isfinite(codes) & (codes > 0), codes, np.float32(0)).astype(np.float32)


def _pixels(where: str, message: Any) -> NDArray[Any]:
    """Give the numbers of a raw image, (H, W) or (H, W, C); rows may be padded to `step` bytes."""
    if message.encoding not in ENCODINGS:
        raise PomonaError(f"{where}: found the encoding {message.encoding!r}, expected one of {', '.join(ENCODINGS)}")
    kind, channels, _ = ENCODINGS[message.encoding]
    numbers = np.dtype((">" if message.is_bigendian else "<") + kind)
    row_bytes = int(message.width) * channels * numbers.itemsize
    height, step = int(message.height), int(message.step) or row_bytes
    body = np.frombuffer(message.data, np.uint8)
    if step < row_bytes or len(body) < step * height:
        expected = f"{message.width}x{message.height} of {message.encoding}"
        raise UnreadablePictureError(f"{where}: found {len(body)} bytes in rows of {step}, expected {expected}")
    rows = np.ascontiguousarray(body[: step * height].reshape(height, step)[:, :row_bytes])
    pixels = rows.view(numbers).astype(numbers.newbyteorder("="), copy=False)
    return pixels if channels == 1 else pixels.reshape(height, -1, channels)


def _decompressed(where: str, message: Any, size_px: tuple[int, int] | None = None) -> NDArray[Any]:
    import cv2

    if is_depth(message):
        raise PomonaError(f"{where}: found {message.format!r}, expected colour or grey")
    return decoded_picture(where, np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR, size_px, FIRST)


def _depth_codes(where: str, message: Any, size_px: tuple[int, int] | None = None) -> NDArray[Any]:
    """Undo `compressed_depth_image_transport`: PNG of 16 bits, of inverse depth where the source was float."""
    import cv2

    body = np.frombuffer(message.data, np.uint8)
    if "rvl" in message.format.lower():
        raise PomonaError(f"{where}: found {message.format!r}, expected compressedDepth in PNG")
    if len(body) <= DEPTH_HEAD.size:
        raise UnreadablePictureError(f"{where}: found {len(body)} bytes, expected a head of 12 and a PNG")
    codes = decoded_picture(where, body[DEPTH_HEAD.size :], cv2.IMREAD_UNCHANGED, size_px, FIRST)
    if not message.format.startswith("32FC1"):
        return codes
    _, a, b = DEPTH_HEAD.unpack(body[: DEPTH_HEAD.size].tobytes())
    with np.errstate(divide="ignore"):
        depth_m = np.float32(a) / (codes.astype(np.float32) - np.float32(b))
    return np.where(codes > 0, depth_m, np.float32(0)).astype(np.float32)


def _require_size(where: str, picture: NDArray[Any], size_px: tuple[int, int]) -> None:
    height, width = picture.shape[:2]
    if (width, height) != size_px:
        expected = f"{size_px[0]}x{size_px[1]} as {FIRST}"
        raise UnreadablePictureError(f"{where}: found {width}x{height} pixels, expected {expected}")
