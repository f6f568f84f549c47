"""Detections from a table: `frame,xmin,ymin,xmax,ymax[,score][,id]`, one line a box.

A recording of a single frame needs no column `frame`.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pomona.detect.detections import Detections
from pomona.errors import PomonaError
from pomona.recording import Calibration, Frame

__all__ = ["FileDetector"]

BOX_COLUMNS = ("xmin", "ymin", "xmax", "ymax")


@dataclass(frozen=True)
class _Box:
    line: int
    corners_px: tuple[float, float, float, float]
    score: float
    id: str


@dataclass(frozen=True, eq=False)
class FileDetector:
    """A detector that knows all its boxes beforehand.

    Attributes
    ----------
    path : Path
        The table.
    by_frame : mapping
        Detections of each frame that has any.
    """

    path: Path
    by_frame: dict[int, Detections]

    @classmethod
    def read(cls, path: Path, calibration: Calibration, numbers: Sequence[int]) -> FileDetector:
        """Read and check a table against the recording it belongs to.

        Parameters
        ----------
        path : Path
            CSV; a score may be missing (then 1), other columns are ignored. Ids are for all boxes or for none.
        calibration : Calibration
            For the size of the pictures. A box partly outside is cut at the picture's edge, one wholly outside is an
            error.
        numbers : sequence of int
            The recording's frame numbers.

        Raises
        ------
        PomonaError
            One line with the file, line and column, what was found and what was expected.
        """
        frames: dict[int, list[_Box]] = {}
        known = set(numbers)
        only = next(iter(numbers)) if len(numbers) == 1 else None
        for number, box in _boxes(path, calibration, only):
            if number not in known:
                have = f"{min(known)} to {max(known)}" if known else "none"
                raise PomonaError(f"{path}: line {box.line}: frame: found {number}, expected a frame there is ({have})")
            frames.setdefault(number, []).append(box)
        _require_ids_of_all_or_none(path, frames)
        return cls(path, {number: _detections(path, number, boxes) for number, boxes in sorted(frames.items())})

    def __call__(self, frame: Frame) -> Detections:
        """Give the boxes of a frame."""
        return self.by_frame.get(frame.number, Detections.none())

    @property
    def with_ids(self) -> bool:
        """Whether every box names its fruit (true of an empty table)."""
        return all(found.ids is not None for found in self.by_frame.values())


def _boxes(path: Path, calibration: Calibration, only: int | None) -> list[tuple[int, _Box]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.reader(file)
            columns = _columns(path, next(rows, []), BOX_COLUMNS if only is not None else ("frame", *BOX_COLUMNS))
            filled = (row for row in rows if any(map(str.strip, row)))
            return [_box(path, rows.line_num, columns, row, calibration, only) for row in filled]
    except FileNotFoundError:
        raise PomonaError(f"{path}: not found, expected boxes: frame,xmin,ymin,xmax,ymax,score[,id]") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise PomonaError(f"{path}: not a CSV text ({error})") from None


def _columns(path: Path, header: list[str], needed: tuple[str, ...]) -> dict[str, int]:
    columns = {name.strip(): index for index, name in enumerate(header)}
    missing = [name for name in needed if name not in columns]
    if missing:
        found = ",".join(header) or "an empty file"
        raise PomonaError(f"{path}: found {found}, expected a header with {', '.join(missing)}")
    return columns


def _box(
    path: Path, line: int, columns: dict[str, int], row: list[str], calibration: Calibration, only: int | None
) -> tuple[int, _Box]:
    where = f"{path}: line {line}"
    if len(row) != len(columns):
        raise PomonaError(f"{where}: found {len(row)} cells, expected {len(columns)} as in the header")
    frame = _frame(where, row[columns["frame"]]) if "frame" in columns or only is None else only
    xmin, ymin, xmax, ymax = (_number(where, name, row[columns[name]]) for name in BOX_COLUMNS)
    for axis, low, high in (("x", xmin, xmax), ("y", ymin, ymax)):
        if low >= high:
            raise PomonaError(f"{where}: found {axis}min {low:g} and {axis}max {high:g}, expected {axis}min below")
    width, height = calibration.size_px
    if xmax <= 0 or ymax <= 0 or xmin >= width or ymin >= height:
        box = f"{xmin:g},{ymin:g},{xmax:g},{ymax:g}"
        raise PomonaError(f"{where}: the box {box} is outside the picture of {width}x{height} pixels")
    score = _number(where, "score", row[columns["score"]]) if "score" in columns else 1.0
    if not 0 <= score <= 1:
        raise PomonaError(f"{where}: score: found {score:g}, expected 0 to 1")
    corners_px = (max(xmin, 0.0), max(ymin, 0.0), min(xmax, float(width)), min(ymax, float(height)))
    name = row[columns["id"]].strip() if "id" in columns else ""
    return frame, _Box(line, corners_px, score, name)


def _frame(where: str, cell: str) -> int:
    frame = _number(where, "frame", cell)
    if frame != int(frame):
        raise PomonaError(f"{where}: frame: found {frame:g}, expected a whole number")
    return int(frame)


def _number(where: str, name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PomonaError(f"{where}: {name}: found {cell.strip()!r}, expected a number")
    return value


def _require_ids_of_all_or_none(path: Path, frames: dict[int, list[_Box]]) -> None:
    boxes = [box for found in frames.values() for box in found]
    nameless = [box.line for box in boxes if not box.id]
    if nameless and len(nameless) < len(boxes):
        raise PomonaError(f"{path}: line {min(nameless)}: id: found none, expected ids for all boxes or for none")


def _detections(path: Path, number: int, boxes: list[_Box]) -> Detections:
    first_line: dict[str, int] = {}
    for box in boxes:
        if box.id and first_line.setdefault(box.id, box.line) != box.line:
            lines = f"lines {first_line[box.id]} and {box.line}"
            raise PomonaError(f"{path}: {lines}: id: found {box.id!r} twice in frame {number}, expected it once")
    return Detections(
        boxes_px=np.array([box.corners_px for box in boxes]),
        scores=np.array([box.score for box in boxes]),
        ids=tuple(box.id for box in boxes) if boxes[0].id else None,
    )
