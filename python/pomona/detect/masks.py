"""Instance masks as boxes: one picture a frame, in which every pixel has the number of its fruit, 0 for none."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.amounts import amount
from pomona.detect.detections import Detections
from pomona.errors import PomonaError
from pomona.recording import Calibration, Frame
from pomona.recording.pictures import UnreadablePictureError, numbered_pictures, read_numbers

__all__ = ["MaskDetector"]

MIN_SIDE_PX = 5
"""Narrower boxes are slivers between leaves: they say neither how large a fruit is nor where its middle lies."""


@dataclass(frozen=True, eq=False)
class MaskDetector:
    """A detector that reads its boxes, with ids, from instance masks.

    Attributes
    ----------
    path : Path
        The folder of `0000.png` ..., of one channel, 8 or 16 bits.
    pictures : dict
        Frame number to file.
    calibration : Calibration
        Of the rectified left pictures, whose pixels the masks have.
    """

    path: Path
    pictures: dict[int, Path]
    calibration: Calibration
    with_ids = True

    @classmethod
    def open(cls, folder: Path, calibration: Calibration) -> MaskDetector:
        """Open a folder of masks; nothing is decoded yet.

        Raises
        ------
        PomonaError
            When there is no picture in it.
        """
        pictures = numbered_pictures(folder)
        if not pictures:
            raise PomonaError(f"{folder}: no pictures found, expected instance masks 0000.png ...")
        return cls(folder, pictures, calibration)

    def __call__(self, frame: Frame) -> Detections:
        """Give the boxes around what each fruit shows in a frame.

        Raises
        ------
        UnreadablePictureError
            When the mask of the frame is not there or cannot be read.
        """
        file = self.pictures.get(frame.number)
        if file is None:
            raise UnreadablePictureError(f"{self.path}: no mask of frame {frame.number}, but of others")
        return boxes_of(read_numbers(file, self.calibration))

    @property
    def inputs(self) -> list[Path]:
        """The pictures."""
        return list(self.pictures.values())

    @property
    def configuration(self) -> dict[str, Any]:
        """What it reads, for a session's provenance."""
        return {"masks": str(self.path.resolve())}

    @property
    def description(self) -> str:
        """Say in one line what is read."""
        return f"{self.path}: instance masks of {amount(len(self.pictures), 'frame')}"


def boxes_of(mask: NDArray[np.integer[Any]]) -> Detections:
    """Give the box around the pixels of each number but 0 in an (H, W) mask."""
    y, x = np.nonzero(mask)
    numbers, fruit = np.unique(mask[y, x], return_inverse=True)
    edges = np.empty((len(numbers), 4))
    for column, places, far in ((0, x, False), (1, y, False), (2, x, True), (3, y, True)):
        edge = np.full(len(numbers), -1 if far else max(mask.shape))
        (np.maximum if far else np.minimum).at(edge, fruit, places)
        edges[:, column] = edge + far  # the far edge of the last pixel
    kept = (edges[:, 2:] - edges[:, :2]).min(axis=1, initial=np.inf) >= MIN_SIDE_PX
    return Detections(edges[kept], np.ones(kept.sum()), tuple(map(str, numbers[kept].tolist())))
