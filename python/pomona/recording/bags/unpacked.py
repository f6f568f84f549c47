"""What a recorder compressed, unpacked up to a bound: a chunk says how large it is, and may say less than it holds."""

from __future__ import annotations

import bz2
import importlib
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

__all__ = ["MOST_CHUNK_BYTES", "UnpackError", "unpack_file", "unpacked"]

MOST_CHUNK_BYTES = 1 << 28
"""256 MiB: recorders close a chunk after about a megabyte, or after one picture; `MOST_PIXELS` in four channels."""

STEP_BYTES = 1 << 20

MOST_RATIO = 1000
"""A whole bag on disk against its compressed file: pictures shrink to a half, pictures of nothing to a hundredth."""


class UnpackError(ValueError):
    """What was compressed is damaged, or larger than anything that is recorded."""


def unpacked(compression: str, content: bytes, declared: int | None = None) -> bytes:
    """Unpack a chunk or a message.

    Parameters
    ----------
    compression : str
        `bz2`, `lz4`, `zstd`; `none` or nothing for what is not compressed.
    content : bytes
        One or several frames of it, one after the other.
    declared : int, optional
        Bytes that must come out.

    Raises
    ------
    UnpackError
        When it is damaged, or more comes out than was declared or than `MOST_CHUNK_BYTES`.
    """
    most = MOST_CHUNK_BYTES if declared is None else declared
    if most > MOST_CHUNK_BYTES:
        raise UnpackError(f"declares {most} bytes, expected at most {MOST_CHUNK_BYTES}")
    if compression in ("", "none"):
        return content
    make = _maker(compression)
    if make is None:
        raise UnpackError(f"compressed as {compression[:20]!r}, expected bz2, lz4 or zstd")
    try:
        plain = _frames(make, content, most)
    except UnpackError:
        raise
    except Exception as error:  # each library has its own, lz4 a RuntimeError
        raise UnpackError((str(error).splitlines() or [type(error).__name__])[0]) from None
    if declared is not None and len(plain) != declared:
        raise UnpackError(f"holds {len(plain)} bytes, expected {declared} as it declares")
    return plain


def unpack_file(packed: Path, plain: Path) -> None:
    """Unpack a file in zstd.

    Raises
    ------
    UnpackError
        When it is damaged, or becomes larger than half of the free space or `MOST_RATIO` times what it was.
    """
    room = min(shutil.disk_usage(plain.parent).free // 2, MOST_RATIO * packed.stat().st_size)
    zstd = _zstd()
    try:
        with packed.open("rb") as source, zstd.open(source, "rb") as unpacking, plain.open("wb") as target:
            while step := unpacking.read(STEP_BYTES):
                room -= len(step)
                if room < 0:
                    raise UnpackError(f"{packed.name}: becomes more than is allowed, {MOST_RATIO} times its size")
                target.write(step)
    except (zstd.ZstdError, EOFError) as error:
        raise UnpackError(f"{packed.name}: {error}") from None


def _maker(compression: str) -> Callable[[], Any] | None:
    """Give what makes a decompressor for one frame; all three take `max_length`."""
    if compression == "bz2":
        return bz2.BZ2Decompressor
    if compression == "lz4":
        import lz4.frame

        make: Callable[[], Any] = lz4.frame.LZ4FrameDecompressor
        return make
    return _zstd().ZstdDecompressor if compression == "zstd" else None


def _zstd() -> Any:
    """Python's own module, which comes with rosbags before Python 3.14."""
    return importlib.import_module("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")


def _frames(make: Callable[[], Any], content: bytes, most: int) -> bytes:
    steps: list[bytes] = []
    room, rest = most, content
    while rest:
        frame = make()
        while not frame.eof:
            step = frame.decompress(rest, max_length=min(STEP_BYTES, room + 1))
            rest = b""
            room -= len(step)
            if room < 0:
                raise UnpackError(f"holds more than the {most} bytes that are allowed")
            if not step and frame.needs_input:
                raise UnpackError("ends within a frame")
            steps.append(step)
        rest = frame.unused_data or b""
    return b"".join(steps)
