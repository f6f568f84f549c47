"""Pictures with boxes around their fruits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.amounts import amount
from pomona.detect.picture_boxes import boxes_within, read_boxes
from pomona.detect.picture_file import pictures_in
from pomona.errors import PomonaError
from pomona.recording.pictures import picture_size

__all__ = ["Labelled", "labelled_pictures"]

LEAST_PICTURES = 5
"""Fewer cannot be split into some to learn from and some to try it on."""

USUAL_PX = 35.0
"""Side of a usual fruit in a picture without any."""

SMALLEST = 0.6
"""Where small fruits have no boxes: what is smaller than this times the usual labelled fruit may be one of them."""


@dataclass(frozen=True, eq=False)
class Labelled:
    """One picture and what is known of it.

    Attributes
    ----------
    picture : Path
        The file.
    boxes_px : (N, 4) float32
        Fruits: xmin, ymin, xmax, ymax.
    visible : (N,) float32
        How much of each fruit is seen, 0 to 1; NaN where nobody knows.
    ignored_px : (M, 4) float32
        Where something may or may not be called a fruit: neither wanted nor punished.
    complete : bool
        Whether every fruit is in one of both; else small ones, of rows behind, are without a box.
    """

    picture: Path
    boxes_px: NDArray[np.float32]
    visible: NDArray[np.float32]
    ignored_px: NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 4), np.float32))
    complete: bool = False

    @property
    def smallest_px(self) -> float:
        """Side, in the geometric mean, from which on a fruit is sure to have a box."""
        if self.complete:
            return 0.0
        sides_px = np.sqrt(np.prod(self.boxes_px[:, 2:] - self.boxes_px[:, :2], axis=1))
        return SMALLEST * float(np.median(sides_px) if len(sides_px) else USUAL_PX)


def labelled_pictures(places: Sequence[Path], boxes: Path) -> list[Labelled]:
    """Read pictures with their boxes; one without a box is one without a fruit.

    Raises
    ------
    PomonaError
        One line with the file and the line, what was found and what was expected.
    """
    pictures = pictures_in(places)
    listed = read_boxes(boxes, pictures)
    labelled = []
    for name, path in pictures.items():
        boxes_px = boxes_within(boxes, listed.get(name, ()), picture_size(path))
        labelled.append(Labelled(path, boxes_px, np.full(len(boxes_px), np.nan, np.float32)))
    if len(labelled) < LEAST_PICTURES or not listed:
        found = f"found {amount(len(labelled), 'picture')} with {amount(sum(map(len, listed.values())), 'box')}"
        raise PomonaError(f"{boxes}: {found}, expected {LEAST_PICTURES} pictures or more, and boxes in them")
    return labelled
