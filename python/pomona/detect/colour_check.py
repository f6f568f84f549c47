"""Whether pictures have the colours that the detector inside looks for."""

from __future__ import annotations

import warnings
from itertools import islice

import numpy as np

from pomona.errors import PomonaWarning
from pomona.recording import Recording
from pomona.recording.pictures import UnreadablePictureError

__all__ = ["check_colour"]

LOOKED_AT = 5
"""Frames from the first on, of which one must be readable."""

GREY_STEPS = 12
"""Steps of 255 by which the channels of a grey picture may differ: H.264 leaves up to 6. The dullest of 437 photographs
and rendered pictures of fruit trees in colour has pixels that differ by 90."""


def check_colour(recording: Recording) -> None:
    """Warn where the first picture is grey: the detector that is inside then may find few of the fruits."""
    for frame in islice(recording.frames(), LOOKED_AT):
        try:
            picture = frame.read_left() if frame.read_left is not None else None
        except UnreadablePictureError:
            continue
        if picture is not None and int(np.ptp(picture.astype(np.int16), axis=2).max()) <= GREY_STEPS:
            found = "the pictures have no colour, and the detector that is inside finds few fruits without it"
            warnings.warn(
                f"{recording.path}: {found}: give --model or --detections of your own", PomonaWarning, stacklevel=3
            )
        return
