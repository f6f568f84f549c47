"""Rows of cells as CSV that every reader takes apart as they were put together."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from typing import IO, Any

__all__ = ["write_rows"]

CARRIAGE_RETURN_TOO = "\r\n"


def write_rows(file: IO[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write rows into a text that was opened with ``newline=""``; each ends with a line feed alone.

    Python quotes a carriage return in a cell only where its rows end with one (before 3.13), and without quotes readers
    begin a new row there: so it is told that they do.
    """
    csv.writer(_LineFeeds(file), lineterminator=CARRIAGE_RETURN_TOO).writerows(rows)


class _LineFeeds:
    """What the writer of the csv module hands its rows to, one at a time."""

    def __init__(self, file: IO[str]) -> None:
        self._file = file

    def write(self, row: str) -> int:
        return self._file.write(row.removesuffix(CARRIAGE_RETURN_TOO) + "\n")
