"""Pictures in linear light as Blender writes them: OpenEXR, uncompressed lines of 32-bit floats."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np

FLOAT = 2
"""OpenEXR's number for 32-bit floats."""


def read_linear(path: Path, width: int, height: int) -> Any:
    """Read red, green and blue, (H, W, 3) float32, of a picture that Blender has just written."""
    content = path.read_bytes()
    attributes, end = _header(content)
    channels = _channels(attributes["channels"])
    # A table of where each line begins, 8 bytes each; a line is its number, its length, then channel after channel.
    lines = np.frombuffer(content, np.uint8, offset=end + 8 * height).reshape(height, -1)
    values = lines[:, 8:].copy().view("<f4").reshape(height, len(channels), width)
    return values[:, [channels.index(name) for name in "RGB"]].transpose(0, 2, 1)


def _header(content: bytes) -> tuple[dict[str, bytes], int]:
    """Read the attributes, each a name, a type and sized bytes, up to an empty name."""
    attributes, at = {}, 8
    while content[at]:
        name, kind = content[at : at + 512].split(b"\0")[:2]
        at += len(name) + len(kind) + 2
        (size,) = struct.unpack_from("<i", content, at)
        attributes[name.decode()] = content[at + 4 : at + 4 + size]
        at += 4 + size
    if attributes["compression"] != b"\0":
        raise ValueError("found a compressed picture, expected a plain one")
    return attributes, at + 1


def _channels(told: bytes) -> list[str]:
    """Names of the channels in the order of the file."""
    names, at = [], 0
    while told[at]:
        name = told[at:].split(b"\0")[0]
        at += len(name) + 1
        if struct.unpack_from("<i", told, at)[0] != FLOAT:
            raise ValueError(f"{name.decode()}: found other values than 32-bit floats")
        names.append(name.decode())
        at += 16
    return names
