"""Boxes of pictures that a table knows by their names, as `pomona detect` writes it, for a recording of pictures."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pomona.amounts import amount
from pomona.detect.detections import Detections
from pomona.detect.picture_boxes import NamedBox, boxes_within, read_boxes
from pomona.reading import read_text
from pomona.recording import Frame

__all__ = ["NamedPictureDetector", "has_picture_names"]


def has_picture_names(path: Path) -> bool:
    """Tell whether a file of boxes is a table that knows pictures by their names."""
    if not path.is_file() or path.suffix.lower() != ".csv":
        return False
    header = next(iter(read_text(path, "a table of boxes").splitlines()), "")
    names = {name.strip() for name in next(csv.reader([header]), [])}
    return "image" in names and "frame" not in names


@dataclass(frozen=True, eq=False)
class NamedPictureDetector:
    """A detector that knows the boxes of pictures beforehand; of a picture without any, nothing was found.

    Attributes
    ----------
    path : Path
        The table.
    boxes : mapping of int to list of NamedBox
        By the number of the frame.
    sizes_px : mapping of int to (width, height)
        Of each frame.
    """

    path: Path
    boxes: Mapping[int, list[NamedBox]]
    sizes_px: Mapping[int, tuple[int, int]]

    @classmethod
    def read(
        cls, path: Path, names: Mapping[str, int], sizes_px: Mapping[int, tuple[int, int]]
    ) -> NamedPictureDetector:
        """Read a table; `names` has the frame number of each picture, `sizes_px` the size of those that are asked for.

        Raises
        ------
        PomonaError
            One line with the file, line and column.
        """
        boxes = {names[name]: found for name, found in read_boxes(path, names).items()}
        return cls(path, boxes, sizes_px)

    def __call__(self, frame: Frame) -> Detections:
        """Give the boxes of a frame."""
        found = self.boxes.get(frame.number)
        if found is None:
            return Detections.none()
        boxes_px = boxes_within(self.path, found, self.sizes_px[frame.number])
        return Detections(boxes_px.astype(np.float64), np.ones(len(boxes_px)))

    @property
    def inputs(self) -> list[Path]:
        """The table."""
        return [self.path]

    @property
    def configuration(self) -> dict[str, Any]:
        """What it reads, for a session's provenance."""
        return {"detections": str(self.path.resolve())}

    @property
    def description(self) -> str:
        """Say in one line what was read."""
        count = sum(map(len, self.boxes.values()))
        return f"{self.path}: {amount(count, 'box')} in {amount(len(self.boxes), 'picture')}"
