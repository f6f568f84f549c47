"""A detector over pictures that belong to no recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from pomona.detect.detections import Detections
from pomona.detect.drawn_boxes import draw_boxes, drawn_name
from pomona.detect.onnx import OnnxDetector
from pomona.detect.picture_file import read_picture

__all__ = ["detect_in"]


def detect_in(
    pictures: Mapping[str, Path],
    detector: OnnxDetector,
    drawn: Path | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> dict[str, Detections]:
    """Find the fruits of each picture by its name.

    Parameters
    ----------
    pictures : mapping
        Files by name.
    detector : OnnxDetector
    drawn : Path, optional
        Folder to draw the boxes into, made where it is not there.
    progress : callable
        Told how many of how many are done.

    Raises
    ------
    UnreadablePictureError
        One of them is no picture.
    """
    found: dict[str, Detections] = {}
    for name, path in pictures.items():
        picture = read_picture(path)
        found[name] = detector.detect(picture)
        if drawn is not None:
            drawn.mkdir(exist_ok=True)
            draw_boxes(drawn / drawn_name(name), picture, found[name])
        progress(len(found), len(pictures))
    return found
