"""A detector over pictures that belong to no recording."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

from pomona.amounts import amount
from pomona.detect.colour_check import colour_amiss, tell_amiss
from pomona.detect.detections import Detections
from pomona.detect.drawn_boxes import draw_boxes, drawn_name
from pomona.detect.onnx import OnnxDetector
from pomona.detect.picture_file import read_picture
from pomona.errors import PomonaWarning
from pomona.recording.pictures import UnreadablePictureError

__all__ = ["detect_in"]


def detect_in(
    pictures: Mapping[str, Path],
    detector: OnnxDetector,
    drawn: Path | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    *,
    is_inside: bool = False,
) -> tuple[dict[str, Detections], dict[str, str]]:
    """Find the fruits of each picture by its name; one that cannot be read is skipped, and a warning says so.

    Parameters
    ----------
    pictures : mapping
        Files by name.
    detector : OnnxDetector
    drawn : Path, optional
        Folder to draw the boxes into, made where it is not there.
    progress : callable
        Told how many of how many are done.
    is_inside : bool
        Whether the detector is the one that is inside, which knows fruits by their colours: where these are amiss a
        warning says so.

    Returns
    -------
    found : dict
        Boxes by name.
    skipped : dict
        Why a picture was skipped, by name.

    Raises
    ------
    UnreadablePictureError
        None of them can be read.
    """
    found: dict[str, Detections] = {}
    skipped: dict[str, str] = {}
    colours: list[str] = []
    for name, path in pictures.items():
        try:
            picture = read_picture(path)
        except UnreadablePictureError as error:
            skipped[name] = str(error)
            if len(skipped) == len(pictures):
                raise
            continue
        found[name] = detector.detect(picture)
        if is_inside and (amiss := colour_amiss(picture)) is not None:
            colours.append(amiss)
        if drawn is not None:
            drawn.mkdir(exist_ok=True)
            draw_boxes(drawn / drawn_name(name), picture, found[name])
        progress(len(found) + len(skipped), len(pictures))
    tell_amiss(colours)
    if skipped:
        message = f"skipped {len(skipped)} of {amount(len(pictures), 'picture')}, first {next(iter(skipped.values()))}"
        warnings.warn(message, PomonaWarning, stacklevel=2)
    return found, skipped
