"""Boxes as our table: `frame,xmin,ymin,xmax,ymax[,score][,id]`, one line a box."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

from pomona.detect.listed import ListedBox
from pomona.errors import PomonaError
from pomona.reading import number_in

__all__ = ["read_csv"]

BOX_COLUMNS = ("xmin", "ymin", "xmax", "ymax")


def read_csv(path: Path, text: str, numbers: Sequence[int]) -> Iterator[ListedBox]:
    """Give the boxes of a table; other columns are ignored, and a recording of one frame needs no column `frame`.

    Raises
    ------
    PomonaError
        One line with the file, line and column, what was found and what was expected.
    """
    only = numbers[0] if len(numbers) == 1 else None
    rows = csv.reader(io.StringIO(text, newline=""))
    try:
        columns = _columns(path, next(rows, []), BOX_COLUMNS if only is not None else ("frame", *BOX_COLUMNS))
        for row in rows:
            if any(map(str.strip, row)):
                yield _box(path, rows.line_num, columns, row, only)
    except csv.Error as error:
        raise PomonaError(f"{path}: line {rows.line_num}: not a CSV text ({error})") from None


def _columns(path: Path, header: list[str], needed: tuple[str, ...]) -> dict[str, int]:
    columns = {name.strip(): index for index, name in enumerate(header)}
    missing = [name for name in needed if name not in columns]
    if missing:
        found = ",".join(header)[:80] or "an empty file"
        raise PomonaError(f"{path}: found {found}, expected a header with {', '.join(missing)}")
    return columns


def _box(path: Path, line: int, columns: dict[str, int], row: list[str], only: int | None) -> ListedBox:
    where = f"{path}: line {line}"
    if len(row) != len(columns):
        raise PomonaError(f"{where}: found {len(row)} cells, expected {len(columns)} as in the header")
    frame = _frame(where, row[columns["frame"]]) if "frame" in columns or only is None else only
    xmin, ymin, xmax, ymax = (number_in(where, name, row[columns[name]]) for name in BOX_COLUMNS)
    score = number_in(where, "score", row[columns["score"]]) if "score" in columns else 1.0
    name = row[columns["id"]].strip() if "id" in columns else ""
    return ListedBox(f"line {line}", frame, (xmin, ymin, xmax, ymax), score, name)


def _frame(where: str, cell: str) -> int:
    frame = number_in(where, "frame", cell)
    if frame != int(frame):
        raise PomonaError(f"{where}: frame: found {frame:g}, expected a whole number")
    return int(frame)
