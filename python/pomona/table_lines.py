"""The lines of a table that people keep in a spreadsheet."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

from pomona.errors import PomonaError
from pomona.reading import read_given_text

__all__ = ["table_lines"]


def table_lines(path: Path, expected: str) -> Iterator[tuple[str, list[str]]]:
    """Give the place and the cells of each line that is not blank, the header first; all are as long as it.

    Parameters
    ----------
    path : Path
    expected : str
        What the table should be, for errors.

    Raises
    ------
    PomonaError
        One line with the file and the line, what was found and what was expected.
    """
    rows = csv.reader(io.StringIO(read_given_text(path, expected), newline=""))
    try:
        header = next(rows, [])
        yield str(path), header
        for cells in rows:
            where = f"{path}: line {rows.line_num}"
            if not any(map(str.strip, cells)):
                continue
            if len(cells) != len(header):
                raise PomonaError(f"{where}: found {len(cells)} cells, expected {len(header)} as in the header")
            yield where, cells
    except csv.Error as error:
        raise PomonaError(f"{path}: line {rows.line_num}: not a CSV text ({error})") from None
