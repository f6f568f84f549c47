"""Decoded pictures in one memory-mapped file, so that a crop costs no decoding."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.detect.picture_file import read_picture
from pomona.detect.training.labels import Labelled

__all__ = ["Sample", "cached"]

MAX_SIDE_PX = 1280
"""Larger pictures are shrunk: so the network will see them."""


_Shape = tuple[int, int, float]
"""Height, width, and by how much it was shrunk."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A decoded picture, (H, W, 3) uint8 BGR, with its labels in its own pixels."""

    pixels: NDArray[np.uint8]
    labelled: Labelled


def cached(pictures: Sequence[Labelled], folder: Path) -> list[Sample]:
    """Decode pictures into a file in `folder`, once, and give them with their labels."""
    name = _name_of(pictures)
    shapes = _shapes_in(folder, name)
    if shapes is None or len(shapes) != len(pictures):
        shapes = _decode_all(pictures, folder, name)
    flat = np.memmap(folder / f"{name}.u8", np.uint8, "r")
    samples, begin = [], 0
    for labelled, (height, width, scale) in zip(pictures, shapes, strict=True):
        end = begin + height * width * 3
        samples.append(Sample(flat[begin:end].reshape(height, width, 3), _scaled(labelled, scale)))
        begin = end
    return samples


def _name_of(pictures: Sequence[Labelled]) -> str:
    stamps = [(str(each.picture.resolve()), each.picture.stat().st_mtime_ns) for each in pictures]
    return sha256(json.dumps(stamps).encode()).hexdigest()[:16]


def _shapes_in(folder: Path, name: str) -> list[_Shape] | None:
    """Read height, width and scale of each decoded picture; None where they are not there whole."""
    try:
        shapes = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
        shapes = [(int(height), int(width), float(scale)) for height, width, scale in shapes]
        n_bytes = (folder / f"{name}.u8").stat().st_size
    except (OSError, ValueError, TypeError):
        return None
    return shapes if sum(height * width * 3 for height, width, _ in shapes) == n_bytes else None


def _decode_all(pictures: Sequence[Labelled], folder: Path, name: str) -> list[_Shape]:
    folder.mkdir(parents=True, exist_ok=True)
    shapes: list[_Shape] = []
    with whole_file(folder / f"{name}.u8") as partial, partial.open("wb") as file:
        for labelled in pictures:
            pixels, scale = _fitted(read_picture(labelled.picture))
            file.write(np.ascontiguousarray(pixels).tobytes())
            shapes.append((*pixels.shape[:2], scale))
    with whole_file(folder / f"{name}.json") as partial:
        partial.write_text(json.dumps(shapes), encoding="utf-8")
    return shapes


def _fitted(pixels: NDArray[np.uint8]) -> tuple[NDArray[Any], float]:
    import cv2

    scale = min(1.0, MAX_SIDE_PX / max(pixels.shape[:2]))
    if scale == 1.0:
        return pixels, 1.0
    return cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), scale


def _scaled(labelled: Labelled, scale: float) -> Labelled:
    by = np.float32(scale)
    return replace(labelled, boxes_px=labelled.boxes_px * by, ignored_px=labelled.ignored_px * by)
