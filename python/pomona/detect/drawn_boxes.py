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

COLOUR, INK = (255, 64, 255), (40, 0, 40)
"""BGR: of boxes and what is below their scores, which no fruit and no leaf has; of the scores."""

USUAL_PX = 1000
"""A smaller picture is drawn so many times as large as comes nearest to it, for scores to be read."""

TEXT_SCALE, TEXT_EDGE_PX = 0.45, 2


def drawn_name(name: str) -> str:
    """Give the name of the drawn picture of a picture."""
    return f"{name}{BOXES_DRAWN}"


def draw_boxes(path: Path, picture: NDArray[np.uint8], found: Detections) -> None:
    """Write a picture, (H, W, 3) uint8 BGR, with its boxes and their scores as PNG; a small one is enlarged."""
    import cv2

    times = max(round(USUAL_PX / max(picture.shape[:2])), 1)
    size_px = (times * picture.shape[1], times * picture.shape[0])
    drawn = np.array(cv2.resize(picture, size_px, interpolation=cv2.INTER_CUBIC), np.uint8)
    boxes = np.round(times * found.boxes_px).astype(int).tolist()
    for corners in boxes:
        cv2.rectangle(drawn, corners[:2], corners[2:], COLOUR, 1)
    for row in np.argsort(found.scores, kind="stable"):  # where they meet, the best lies on top
        _write_score(drawn, boxes[row], found.scores[row])
    write_png(path, drawn, BOXES_DRAWN_MARK)


def _write_score(drawn: NDArray[np.uint8], corners: list[int], score: float) -> None:
    """Write a score on a ground of its own above its box, below the box's upper edge where there is no room above."""
    import cv2

    font = cv2.FONT_HERSHEY_SIMPLEX
    (width, height), _ = cv2.getTextSize(f"{score:.2f}", font, TEXT_SCALE, 1)
    width, height = width + 2 * TEXT_EDGE_PX, height + 2 * TEXT_EDGE_PX
    left = max(min(corners[0], drawn.shape[1] - width), 0)
    top = corners[1] - height if corners[1] >= height else max(corners[1], 0)
    cv2.rectangle(drawn, (left, top), (left + width, top + height), COLOUR, cv2.FILLED)
    place = (left + TEXT_EDGE_PX, top + height - TEXT_EDGE_PX)
    cv2.putText(drawn, f"{score:.2f}", place, font, TEXT_SCALE, INK, 1, cv2.LINE_AA)


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
