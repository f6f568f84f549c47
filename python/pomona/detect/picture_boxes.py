"""Boxes in pictures as a table: `image,xmin,ymin,xmax,ymax[,score]`, one line a box."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.csv_rows import write_rows
from pomona.detect.detections import Detections
from pomona.errors import PomonaError
from pomona.reading import number_in, read_text, shown

__all__ = ["COLUMNS", "NamedBox", "boxes_within", "read_boxes", "table_of"]

CORNERS = ("xmin", "ymin", "xmax", "ymax")
COLUMNS = ("image", *CORNERS, "score")
NEEDED = COLUMNS[:5]


@dataclass(frozen=True, slots=True)
class NamedBox:
    """One box of a table.

    Attributes
    ----------
    line : int
        Of the file.
    corners_px : tuple of four float
        xmin, ymin, xmax, ymax.
    """

    line: int
    corners_px: tuple[float, float, float, float]


def table_of(found: Iterable[tuple[str, Detections]]) -> str:
    """Write boxes of named pictures as a table."""
    text = io.StringIO(newline="")
    write_rows(text, [COLUMNS])
    for name, detections in found:
        boxes = zip(detections.boxes_px, detections.scores, strict=True)
        write_rows(text, ((name, *(f"{px:.2f}" for px in corners_px), f"{score:.4f}") for corners_px, score in boxes))
    return text.getvalue()


def read_boxes(path: Path, names: Collection[str]) -> dict[str, list[NamedBox]]:
    """Read a table of boxes by picture; other columns are ignored, a picture without a box has none.

    Parameters
    ----------
    path : Path
        The table.
    names : collection of str
        Pictures that there are.

    Raises
    ------
    PomonaError
        One line with the file, line and column, what was found and what was expected.
    """
    rows = csv.reader(io.StringIO(read_text(path, f"a table {','.join(NEEDED)}"), newline=""))
    boxes: dict[str, list[NamedBox]] = {}
    known = set(names)
    try:
        header = [name.strip() for name in next(rows, [])]
        if not set(NEEDED) <= set(header):
            found = shown(",".join(header)) if header else "an empty file"
            raise PomonaError(f"{path}: found {found}, expected a header with {', '.join(NEEDED)}")
        for row in rows:
            if any(map(str.strip, row)):
                name, box = _box(f"{path}: line {rows.line_num}", rows.line_num, header, row)
                if name not in known:
                    raise PomonaError(f"{path}: line {box.line}: image: found {shown(name)}, which is no picture there")
                boxes.setdefault(name, []).append(box)
    except csv.Error as error:
        raise PomonaError(f"{path}: line {rows.line_num}: not a CSV text ({error})") from None
    return boxes


def _box(where: str, line: int, header: list[str], row: list[str]) -> tuple[str, NamedBox]:
    if len(row) != len(header):
        raise PomonaError(f"{where}: found {len(row)} cells, expected {len(header)} as in the header")
    cells = dict(zip(header, row, strict=True))
    xmin, ymin, xmax, ymax = (number_in(where, name, cells[name]) for name in CORNERS)
    for axis, low, high in (("x", xmin, xmax), ("y", ymin, ymax)):
        if low >= high:
            raise PomonaError(f"{where}: found {axis}min {low:g} and {axis}max {high:g}, expected {axis}min below")
    return cells["image"].strip(), NamedBox(line, (xmin, ymin, xmax, ymax))


def boxes_within(path: Path, boxes: Iterable[NamedBox], size_px: tuple[int, int]) -> NDArray[np.float32]:
    """Cut boxes at the edges of their picture of width and height `size_px`, (N, 4).

    Raises
    ------
    PomonaError
        A box is wholly outside.
    """
    width, height = size_px
    cut = []
    for box in boxes:
        xmin, ymin, xmax, ymax = box.corners_px
        if xmax <= 0 or ymax <= 0 or xmin >= width or ymin >= height:
            found = f"the box {xmin:g},{ymin:g},{xmax:g},{ymax:g} is outside the picture of {width}x{height} pixels"
            raise PomonaError(f"{path}: line {box.line}: {found}")
        cut.append((max(xmin, 0.0), max(ymin, 0.0), min(xmax, width), min(ymax, height)))
    return np.array(cut, np.float32).reshape(-1, 4)
