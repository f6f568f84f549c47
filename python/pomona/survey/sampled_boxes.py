"""Boxes of a few frames, evenly over those that have some, for checks that look at pictures again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.survey.part import Boxes

__all__ = ["LOOKED_AT", "frames_in_words", "sampled_boxes"]

LOOKED_AT = 5
"""Frames."""


def sampled_boxes(parts: Sequence[Boxes]) -> dict[int, NDArray[np.float64]]:
    """Give the boxes, (D, 4) pixels, of a few frames by their numbers."""
    frames = [frame for boxes in parts for frame in dict.fromkeys(boxes.frames.tolist())]
    rows = (2 * np.arange(LOOKED_AT) + 1) * len(frames) // (2 * LOOKED_AT)
    shown = [frames[row] for row in dict.fromkeys(rows.tolist())] if frames else []
    return {frame: boxes.boxes_px[boxes.frames == frame] for boxes in parts for frame in shown if frame in boxes.frames}


def frames_in_words(away: int) -> str:
    """Say how many frames lie between two."""
    return "a frame" if abs(away) == 1 else f"{abs(away)} frames"
