"""Which recordings a farm has: by the pattern of their names, or by a table."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise
from pathlib import Path

from pomona.calendar_days import expected_day
from pomona.errors import PomonaError
from pomona.reading import shown
from pomona.table_lines import table_lines

__all__ = ["RecordedVisit", "visits_by_pattern", "visits_by_table"]

FIELDS = ("row", "date")
COLUMNS = ("row", "date", "recording")
MOST_NAME = 100
"""Characters of a row's name: it becomes the name of files."""

MOST_STARS = 4
"""In a pattern: with many, names of strangers take for ever to compare."""

ROW = r"(?P<row>[^/]+?)"
DATE = r"(?P<date>\d{4}-?\d{2}-?\d{2}(?:[T_ ]\d{2}[:-]?\d{2}(?:[:-]?\d{2})?)?)"
DATE_PARTS = re.compile(r"(\d{4})-?(\d{2})-?(\d{2})(?:[T_ ](\d{2})[:-]?(\d{2})(?:[:-]?(\d{2}))?)?")


@dataclass(frozen=True, order=True)
class RecordedVisit:
    """One recording of one row on one date.

    Attributes
    ----------
    row : str
        Name of the row.
    date : str
        ISO 8601 day, or day and time.
    path : Path
        The recording; or a session (.gpkg) or a cloud (.csv, .ply), which need no scan.
    """

    row: str
    date: str
    path: Path

    @property
    def needs_scan(self) -> bool:
        """Whether its fruits have still to be found."""
        return self.path.suffix.lower() not in (".gpkg", ".csv", ".ply")

    @property
    def title(self) -> str:
        """How people find it in the plan and in the table at the end."""
        return f"{self.row}/{self.date}"


def visits_by_pattern(where: str, folder: Path, pattern: str) -> list[RecordedVisit]:
    """Find what is called as the pattern says, as ``{row}/{date}.mp4``, below a folder; ``*`` is anything in a name.

    Raises
    ------
    PomonaError
        The pattern has not both fields, nothing is called like that, or two are of one row and date.
    """
    for field in FIELDS:
        if pattern.count(f"{{{field}}}") != 1:
            raise PomonaError(
                f"{where}: found {pattern!r}, expected {{{field}}} in it, once, as in {{row}}/{{date}}.mp4"
            )
    if pattern.count("*") > MOST_STARS:
        raise PomonaError(f"{where}: found {pattern.count('*')} stars, expected {MOST_STARS} at the most")
    if not folder.is_dir():
        raise PomonaError(f"{where}: {folder}: is not there, expected the folder of the recordings")
    called, depth = _expression(pattern), pattern.count("/") + 1
    found = []
    for path in _below(folder, depth):
        match = called.fullmatch(path.relative_to(folder).as_posix())
        if match is not None:
            named = f"{where}: {path}"
            found.append(RecordedVisit(_row(named, match["row"]), _date(named, match["date"]), path))
    if not found:
        raise PomonaError(f"{where}: nothing below {folder} is called {pattern}")
    return _once(where, found)


def visits_by_table(table: Path) -> list[RecordedVisit]:
    """Read a table with the columns row, date, recording; the recordings are named from the table's folder.

    Raises
    ------
    PomonaError
        The table cannot be read, lacks a column, names what is not there, or names two of one row and date.
    """
    lines = table_lines(table, "a table with the columns row,date,recording")
    _, header = next(lines)
    for name in COLUMNS:
        if (count := header.count(name)) != 1:
            found = f"found {count} columns {name}" if count else f"has no column {name}"
            raise PomonaError(f"{table}: line 1: {found}, expected row,date,recording")
    visits = []
    for where, cells in lines:
        row, date, name = (cells[header.index(column)].strip() for column in COLUMNS)
        path = table.parent / name
        if not name or not (path.is_file() or path.is_dir()):
            what = "is no file and no folder" if name and path.exists() else "is not there"
            raise PomonaError(f"{where}: recording: {shown(name)} {what}")
        visits.append(RecordedVisit(_row(where, row), _date(where, date), path))
    if not visits:
        raise PomonaError(f"{table}: has no line, expected one a recording")
    return _once(str(table), visits)


def _expression(pattern: str) -> re.Pattern[str]:
    pieces = re.split(r"(\{row\}|\{date\}|\*)", pattern)
    meaning = {"{row}": ROW, "{date}": DATE, "*": "[^/]*"}
    return re.compile("".join(meaning.get(piece) or re.escape(piece) for piece in pieces))


def _below(folder: Path, depth: int) -> Iterator[Path]:
    """Give all paths so many names below a folder, in the order of their names; hidden ones are nobody's recordings."""
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if depth == 1:
            yield path
        elif path.is_dir():
            yield from _below(path, depth - 1)


def _row(where: str, name: str) -> str:
    """Take the name of a row, which becomes the name of files, however its accents were written."""
    name = unicodedata.normalize("NFC", name)
    odd = (
        not name
        or name != name.strip()
        or len(name) > MOST_NAME
        or name.startswith((".", "-"))
        or not name.isprintable()
    )
    if odd or set(name) & set('/\\:*?"<>|'):
        raise PomonaError(f"{where}: row: found {shown(name)}, expected a name that a file can have")
    return name


def _date(where: str, text: str) -> str:
    parts = DATE_PARTS.fullmatch(text)
    try:
        if parts is None:
            raise ValueError
        year, month, day, hour, minute, second = (int(part or 0) for part in parts.groups())
        date = datetime(year, month, day, hour, minute, second)  # local, as the farm's clock
    except ValueError:
        expected = expected_day(text, "one like 2024-08-09")
        raise PomonaError(f"{where}: date: found {shown(text)}, {expected}") from None
    return date.date().isoformat() if parts[4] is None else date.isoformat()


def _once(where: str, found: Iterable[RecordedVisit]) -> list[RecordedVisit]:
    """Give them in order; one row has one recording a date, and its name is written in one way."""
    visits = sorted(found)
    for one, other in pairwise(visits):
        if (one.row, one.date) == (other.row, other.date):
            raise PomonaError(
                f"{where}: {one.path} and {other.path} are both row {one.row} on {one.date}, expected one recording of "
                "a row and date; times in the names tell two of one day apart"
            )
    spelt: dict[str, str] = {}
    for visit in visits:
        if spelt.setdefault(visit.row.casefold(), visit.row) != visit.row:
            raise PomonaError(
                f"{where}: found the rows {spelt[visit.row.casefold()]} and {visit.row}, expected one name"
            )
    return visits
