"""Diameters by hand, out of a table: a line a measurement, or a line a fruit with a column a day."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from statistics import median

from pomona.calendar_days import expected_day
from pomona.errors import PomonaError
from pomona.reading import number_in, shown
from pomona.table_lines import table_lines

__all__ = ["Measurement", "read_calipers"]

NAMES = ("fruit_id", "label", "id")
"""Column of the fruit: the map's number, or the sessions' own name of it."""

MM_PER = {"diameter_mm": 1.0, "diameter_cm": 10.0, "diameter_m": 1000.0}

PLAUSIBLE_MM = (5.0, 200.0)
"""A cherry to a melon."""

_EXPECTED = "fruit_id or label, date, diameter_mm; or fruit_id or label, and a column of mm for each day"


@dataclass(frozen=True)
class Measurement:
    """One diameter.

    Attributes
    ----------
    where : str
        File and line.
    name : str
        Of the fruit.
    is_number : bool
        Whether the name is the map's number of the fruit, from a column `fruit_id`.
    day : date or None
        None where the table has no date.
    diameter_mm : float
    """

    where: str
    name: str
    is_number: bool
    day: date | None
    diameter_mm: float


def read_calipers(path: Path) -> tuple[Measurement, ...]:
    """Read a table of calipers; blank cells are what was not measured.

    Raises
    ------
    PomonaError
        One line: a column that is missing, a unit that is not known, a size that is no number or not above 0, a fruit
        measured twice on a day, sizes that no fruit has.
    """
    lines = table_lines(path, _EXPECTED)
    header = [name.strip() for name in next(lines)[1]]
    name_column = next((name for name in NAMES if name in header), None)
    if name_column is None:
        raise PomonaError(f"{path}: found the header {shown(','.join(header))}, expected {_EXPECTED}")
    columns = _columns(path, header)
    found: dict[tuple[str, date | None], Measurement] = {}
    for where, cells in lines:
        for one in _of_line(where, dict(zip(header, cells, strict=True)), name_column, columns):
            if (one.name, one.day) in found:
                raise PomonaError(f"{where}: found fruit {shown(one.name)} a second time{_on(one.day)}, expected once")
            found[one.name, one.day] = one
    _require_plausible(path, found.values())
    return tuple(found.values())


def _columns(path: Path, header: list[str]) -> dict[str, float] | dict[str, date]:
    """Give the column of diameters with its unit, or the columns of days."""
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise PomonaError(f"{path}: column {shown(twice)} is there twice, expected each name once")
    sizes = {name: factor for name, factor in MM_PER.items() if name in header}
    if len(sizes) == 1:
        return sizes
    days = {name: day for name in header if (day := _day_or_none(name)) is not None}
    if days and not sizes:
        return days
    odd = next((name for name in header if name.startswith("diameter") and name not in MM_PER), None)
    found = f"the column {shown(odd)}" if odd else f"the header {shown(','.join(header))}"
    raise PomonaError(
        f"{path}: found {found}, expected one of {', '.join(MM_PER)}, or columns of mm called by their day"
    )


def _of_line(
    where: str, row: dict[str, str], name_column: str, columns: dict[str, float] | dict[str, date]
) -> Iterator[Measurement]:
    name = row[name_column].strip()
    if not name:
        raise PomonaError(f"{where}: {name_column}: found nothing, expected the name of a fruit")
    for column, meaning in columns.items():
        if not row[column].strip():
            continue
        day, mm_per = (meaning, 1.0) if isinstance(meaning, date) else (_date_of(where, row), meaning)
        value = mm_per * number_in(where, column, row[column])
        if value <= 0:
            raise PomonaError(f"{where}: {column}: found {shown(row[column])}, expected a diameter above 0")
        yield Measurement(where, name, name_column == "fruit_id", day, value)


def _date_of(where: str, row: dict[str, str]) -> date | None:
    if "date" not in row:
        return None
    day = _day_or_none(row["date"])
    if day is None:
        expected = expected_day(row["date"], "a day as 2024-08-09")
        raise PomonaError(f"{where}: date: found {shown(row['date'])}, {expected}")
    return day


def _day_or_none(text: str) -> date | None:
    try:
        return date.fromisoformat(text.strip())
    except ValueError:
        return None


def _require_plausible(path: Path, measurements: Iterable[Measurement]) -> None:
    sizes_mm = [one.diameter_mm for one in measurements]
    if not sizes_mm:
        raise PomonaError(f"{path}: found no diameters, expected {_EXPECTED}")
    low, high = PLAUSIBLE_MM
    if not low <= (middle := median(sizes_mm)) <= high:
        raise PomonaError(
            f"{path}: found a median of {middle:.3g} mm, expected {low:g} to {high:g} mm: say the unit in the name of "
            f"the column, one of {', '.join(MM_PER)}"
        )


def _on(day: date | None) -> str:
    return f" on {day}" if day else ""
