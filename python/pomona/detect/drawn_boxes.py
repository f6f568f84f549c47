"""Boxes drawn over their picture."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.detect.detections import Detections
from pomona.errors import PomonaError
from pomona.likes import BOXES_DRAWN, BOXES_DRAWN_MARK

__all__ = ["draw_boxes", "drawn_name", "write_png"]

COLOUR = (255, 64, 255)
"""BGR: no fruit and no leaf has it."""


def drawn_name(name: str) -> str:
    """Give the name of the drawn picture of a picture."""
    return f"{name}{BOXES_DRAWN}"


def draw_boxes(path: Path, picture: NDArray[np.uint8], found: Detections) -> None:
    """Write a picture, (H, W, 3) uint8 BGR, with its boxes and their scores as PNG."""
    import cv2

    drawn = picture.copy()
    for corners, score in zip(np.round(found.boxes_px).astype(int).tolist(), found.scores, strict=True):
        cv2.rectangle(drawn, corners[:2], corners[2:], COLOUR, 1)
        place = (corners[0], max(corners[1] - 2, 8))
        cv2.putText(drawn, f"{score:.2f}", place, cv2.FONT_HERSHEY_SIMPLEX, 0.35, COLOUR, 1, cv2.LINE_AA)
    write_png(path, drawn, BOXES_DRAWN_MARK)


PNG_HEAD_BYTES = 33
"""Signature and size of a PNG; texts may follow."""


def write_png(path: Path, picture: NDArray[np.uint8], text: bytes = b"") -> None:
    """Write a picture, (H, W, 3) uint8 BGR, whole or not at all; `text` is a keyword, a zero byte and Latin-1."""
    import cv2

    done, encoded = cv2.imencode(".png", picture)
    if not done:
        raise PomonaError(f"{path}: cannot be encoded as PNG")
    content = encoded.tobytes()
    chunk = b"tEXt" + text
    signed = len(text).to_bytes(4, "big") + chunk + zlib.crc32(chunk).to_bytes(4, "big") if text else b""
    with whole_file(path) as partial:
        partial.write_bytes(content[:PNG_HEAD_BYTES] + signed + content[PNG_HEAD_BYTES:])
