"""Whether every picture of a recording can be read, and shows something."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pomona.recording.alignment import alignment_of
from pomona.recording.frame import Recording
from pomona.recording.pictures import UnreadablePictureError

__all__ = ["Checked", "checked", "is_blank"]

BLANK_SIGMA = 2.0
"""Grey levels of 255: a covered lens or a lost exposure varies less over the picture, and leaves far more."""

BLOCKS = (64, 36)
"""A picture is averaged over so many blocks first, so that the sensor's noise does not count."""


@dataclass(frozen=True)
class Checked:
    """What is wrong with single frames: number of the frame, and why, in one line.

    Attributes
    ----------
    unreadable : dict
        A picture is missing, cut off or corrupt.
    blank : dict
        A picture shows nothing: it is black, white or plain.
    misaligned : str or None
        How the right pictures lie to the left ones, where their rows are not the same.
    is_spoiled : bool
        Whether a scan cannot take that out.
    """

    unreadable: dict[int, str] = field(default_factory=dict)
    blank: dict[int, str] = field(default_factory=dict)
    misaligned: str | None = None
    is_spoiled: bool = False


def checked(recording: Recording, progress: Callable[[int, int], None] | None = None) -> Checked:
    """Decode all pictures, one frame after the other.

    Parameters
    ----------
    recording : Recording
        Any kind.
    progress : callable, optional
        Called after each frame with frames done and frames in all.
    """
    found = Checked()
    for done, frame in enumerate(recording.frames(), start=1):
        for side, read in (("left", frame.read_left), ("right", frame.read_right), ("depth", frame.read_depth)):
            try:
                picture = None if read is None else read()
            except UnreadablePictureError as error:
                found.unreadable.setdefault(frame.number, str(error))
                continue
            if picture is not None and picture.dtype == np.uint8 and is_blank(np.asarray(picture, np.uint8)):
                level = f"grey level {picture.mean():.0f} of 255 all over"
                where = f"{recording.path}: frame {frame.number}"
                found.blank.setdefault(frame.number, f"{where}: the {side} picture shows nothing: {level}")
        if progress is not None:
            progress(done, len(recording))
    alignment = alignment_of(recording)
    if alignment is None or not alignment.is_off:
        return found
    return replace(found, misaligned=str(alignment), is_spoiled=not alignment.is_correctable)


def is_blank(picture: NDArray[np.uint8]) -> bool:
    """Whether a picture (H, W, 3) shows nothing."""
    import cv2

    blocks = cv2.resize(picture, BLOCKS, interpolation=cv2.INTER_AREA)
    return bool(np.asarray(blocks, np.float64).std(axis=(0, 1)).max() < BLANK_SIGMA)
