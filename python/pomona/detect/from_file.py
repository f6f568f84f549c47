"""Detections and tracks that were made beforehand: our table, MOTChallenge text, COCO json."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pomona.amounts import amount
from pomona.detect.coco import read_coco
from pomona.detect.csv_table import read_csv
from pomona.detect.detections import Detections
from pomona.detect.listed import ListedBox, by_frame
from pomona.detect.looked_at import looked_at
from pomona.detect.mot import is_mot, read_mot
from pomona.errors import PomonaError
from pomona.reading import read_text
from pomona.recording import Calibration, Frame

__all__ = ["FileDetector"]

EXPECTED = "boxes: a table frame,xmin,ymin,xmax,ymax[,score][,id], MOTChallenge text or COCO json"


@dataclass(frozen=True, eq=False)
class FileDetector:
    """A detector that knows all its boxes beforehand.

    Attributes
    ----------
    path : Path
        The file.
    by_frame : mapping
        Detections of each frame that has any.
    looked_at : collection of int
        Frames that were looked at, with boxes or without.
    """

    path: Path
    by_frame: dict[int, Detections]
    looked_at: Collection[int]

    @classmethod
    def read(cls, path: Path, calibration: Calibration, numbers: Sequence[int]) -> FileDetector:
        """Read a file of boxes and check it against the recording it belongs to.

        Parameters
        ----------
        path : Path
            Our table, MOTChallenge text or COCO json, told apart by what is in it. A score may be missing (then 1). Ids
            are for all boxes or for none.
        calibration : Calibration
            For the size of the pictures. A box partly outside is cut at the picture's edge, one wholly outside is an
            error.
        numbers : sequence of int
            All frames of the recording in order of time, `Recording.recorded_numbers`: who made the file saw them all.

        Raises
        ------
        PomonaError
            One line with the file, line and field, what was found and what was expected.
        """
        boxes, listed = _boxes(path, _text(path), calibration, numbers)
        found = by_frame(path, boxes, calibration, numbers)
        if listed is None:
            listed = looked_at(numbers, {number: len(boxes) for number, boxes in found.items()})
        return cls(path, found, listed)

    def __call__(self, frame: Frame) -> Detections:
        """Give the boxes of a frame."""
        found = self.by_frame.get(frame.number)
        return Detections.none(looked=frame.number in self.looked_at) if found is None else found

    @property
    def with_ids(self) -> bool:
        """Whether every box names its fruit (true of an empty file)."""
        return all(found.ids is not None for found in self.by_frame.values())

    @property
    def inputs(self) -> list[Path]:
        """The file."""
        return [self.path]

    @property
    def configuration(self) -> dict[str, Any]:
        """What it reads, for a session's provenance."""
        return {"detections": str(self.path.resolve())}

    @property
    def description(self) -> str:
        """Say in one line what was read."""
        boxes = sum(map(len, self.by_frame.values()))
        ids = " with ids" if self.with_ids and boxes else ""
        return f"{self.path}: {amount(boxes, 'box')}{ids} in {amount(len(self.by_frame), 'frame')}"


def _boxes(
    path: Path, text: str, calibration: Calibration, numbers: Sequence[int]
) -> tuple[Iterator[ListedBox], Collection[int] | None]:
    """Give the boxes, and the frames that the file lists, where its kind lists frames."""
    first = next(filter(str.strip, text.splitlines()), "")
    if first.lstrip().startswith(("{", "[")):
        return read_coco(path, text, calibration)
    # A text without lines is how trackers say that they saw nothing; a table has a header at least.
    if is_mot(first) or (not first and path.suffix.lower() == ".txt"):
        return read_mot(path, text, numbers), None
    return read_csv(path, text, numbers), None


def _text(path: Path) -> str:
    if path.suffix.lower() == ".onnx":
        raise PomonaError(f"{path}: found a model, expected {EXPECTED}; a model goes with --model")
    return read_text(path, EXPECTED)
