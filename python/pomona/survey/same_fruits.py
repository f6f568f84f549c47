"""Two pictures of two visits below each other, with the fruits that both show under their common names."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.detect.drawn_boxes import write_png
from pomona.errors import PomonaError
from pomona.recording import Recording
from pomona.survey.lettering import colour_of, lettering, write_on
from pomona.survey.part import Boxes

__all__ = ["Seen", "draw_same_fruits"]

TIMES = 2
"""Pictures are enlarged so many times, for the letters."""


@dataclass(frozen=True, eq=False)
class Seen:
    """A visit that was scanned.

    Attributes
    ----------
    recording : Recording
    boxes : Boxes
    fruit_ids : (N,) int64
        Identity in the map of each fruit of the scan.
    """

    recording: Recording
    boxes: Boxes
    fruit_ids: NDArray[np.int64]

    def ids_in(self, frame: int) -> set[int]:
        """Give the identities that a frame shows."""
        rows = (self.boxes.frames == frame) & (self.boxes.fruits >= 0)
        return set(self.fruit_ids[self.boxes.fruits[rows]].tolist())


def draw_same_fruits(path: Path, one: Seen, other: Seen) -> int:
    """Write the two pictures that have most fruits in common as PNG; give the number of these fruits.

    Raises
    ------
    PomonaError
        No two frames have a fruit in common, or a picture cannot be read.
    """
    frames = _most_in_common(one, other)
    common = one.ids_in(frames[0]) & other.ids_in(frames[1])
    if not common:
        raise PomonaError(f"{path}: found no two frames with a fruit in common, expected some")
    drawn = [_drawn(seen, frame, common) for seen, frame in zip((one, other), frames, strict=True)]
    write_png(path, np.vstack(drawn))
    return len(common)


def _most_in_common(one: Seen, other: Seen) -> tuple[int, int]:
    """Frames that share most identities, the first of them."""
    shown = [{int(frame): seen.ids_in(int(frame)) for frame in np.unique(seen.boxes.frames)} for seen in (one, other)]
    pairs = (
        (len(here & there), -first, -second) for first, here in shown[0].items() for second, there in shown[1].items()
    )
    _, first, second = max(pairs, default=(0, 0, 0))
    return -first, -second


def _drawn(seen: Seen, frame: int, common: set[int]) -> NDArray[np.uint8]:
    import cv2

    read = next(each.read_left for each in seen.recording.frames() if each.number == frame)
    if read is None:
        raise PomonaError(f"{seen.recording.path}: frame {frame}: found no left picture, expected one")
    picture = np.asarray(cv2.resize(read(), None, fx=TIMES, fy=TIMES, interpolation=cv2.INTER_CUBIC), np.uint8)
    size = lettering(picture.shape[0])
    boxes = seen.boxes
    for row in np.flatnonzero((boxes.frames == frame) & (boxes.fruits >= 0)):
        name = int(seen.fruit_ids[boxes.fruits[row]])
        if name in common:
            low, high = np.round(TIMES * boxes.boxes_px[row]).astype(int).reshape(2, 2).tolist()
            cv2.rectangle(picture, low, high, colour_of(name), 2)
            write_on(picture, (low[0], low[1] - 4 * size), str(name), colour_of(name), size)
    return picture
