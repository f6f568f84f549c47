"""The time that fruits grow by: days, or degree days out of a table of temperatures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from pomona.calendar_days import expected_day
from pomona.errors import PomonaError
from pomona.reading import number_in, shown
from pomona.table_lines import table_lines

__all__ = ["CALENDAR", "Calendar", "DegreeDays", "SeasonClock", "read_temperatures"]

BASE_C = 5.0
"""Daily mean below which apples do not grow."""

PLAUSIBLE_C = (-60.0, 60.0)

_EXPECTED = "a table with date and mean_c, or date, min_c and max_c"

_USUAL_DAYS = 30
"""Days at the end of the table whose mean stands for the days after it."""


class SeasonClock(Protocol):
    """Turns moments into a time that fruits grow by."""

    @property
    def name(self) -> Literal["days", "degree days"]:
        """What it counts."""
        ...

    def times(self, moments: Sequence[datetime]) -> NDArray[np.float64]:
        """Time of each moment, (M,), in days."""
        ...

    def per_day(self, moment: datetime) -> float:
        """How fast it runs then, 1 for a usual day."""
        ...


@dataclass(frozen=True)
class Calendar:
    """Days as they are."""

    name: Literal["days"] = "days"

    def times(self, moments: Sequence[datetime]) -> NDArray[np.float64]:
        """Days, (M,)."""
        return np.array([moment.toordinal() + _share_of_day(moment) for moment in moments])

    def per_day(self, moment: datetime) -> float:  # noqa: ARG002
        """Return 1."""
        return 1.0


CALENDAR = Calendar()


class DegreeDays:
    """Degree days above `BASE_C`, in the length of a mean day between two moments, so that rates stay rates a day.

    Parameters
    ----------
    means_c : mapping of date to float
        Daily mean temperatures, without gaps.
    first, last : datetime
        Over which a mean day is a day long.
    """

    name: Literal["degree days"] = "degree days"

    def __init__(self, means_c: dict[date, float], first: datetime, last: datetime) -> None:
        self._first_day = min(means_c)
        degrees = [max(0.0, means_c[day] - BASE_C) for day in sorted(means_c)]
        self._degrees = np.array(degrees)
        self._usual = float(np.mean(degrees[-_USUAL_DAYS:]))
        begin, end = self._sums([first, last])
        if not end > begin:
            raise PomonaError(f"temperature: found no day above {BASE_C:g} degrees between the visits, expected some")
        self._length = (end - begin) / (CALENDAR.times([last]) - CALENDAR.times([first]))[0]

    def times(self, moments: Sequence[datetime]) -> NDArray[np.float64]:
        """Degree days since the table begins, (M,), in mean days."""
        return np.asarray(self._sums(moments) / self._length)

    def per_day(self, moment: datetime) -> float:
        """Degrees of that day against a mean day."""
        day = (moment.date() - self._first_day).days
        return float((self._degrees[day] if day < len(self._degrees) else self._usual) / self._length)

    def _sums(self, moments: Sequence[datetime]) -> NDArray[np.float64]:
        at = CALENDAR.times(moments) - self._first_day.toordinal()
        sums = np.concatenate([[0.0], np.cumsum(self._degrees)])
        after = np.maximum(at - len(self._degrees), 0.0) * self._usual
        return np.asarray(np.interp(at, np.arange(len(sums)), sums) + after)


def read_temperatures(path: Path, days: Sequence[date]) -> dict[date, float]:
    """Read daily mean temperatures that cover all visits.

    Parameters
    ----------
    path : Path
        CSV with ``date`` and ``mean_c``, or ``min_c`` and ``max_c``, of which the middle is taken.
    days : sequence of date
        The visits.

    Raises
    ------
    PomonaError
        One line with the file and the line, what was found and what was expected.
    """
    means_c: dict[date, float] = {}
    for where, day, mean_c in _rows(path):
        if day in means_c:
            raise PomonaError(f"{where}: found {day} a second time, expected each day once")
        means_c[day] = mean_c
    if not means_c:
        raise PomonaError(f"{path}: found no days, expected {_EXPECTED}")
    first, last = min(means_c), max(means_c)
    if first > min(days) or last < max(days):
        raise PomonaError(f"{path}: found {first} to {last}, expected all days from {min(days)} to {max(days)}")
    for number in range((last - first).days):
        if (day := first + timedelta(days=number)) not in means_c:
            raise PomonaError(f"{path}: found no {day}, expected every day from {first} to {last}")
    return means_c


def _rows(path: Path) -> Iterator[tuple[str, date, float]]:
    lines = table_lines(path, _EXPECTED)
    header = [name.strip().lower() for name in next(lines)[1]]
    columns = next((names for names in (("mean_c",), ("min_c", "max_c")) if set(names) <= set(header)), None)
    if "date" not in header or columns is None:
        raise PomonaError(f"{path}: found the header {shown(','.join(header))}, expected {_EXPECTED}")
    for where, cells in lines:
        row = dict(zip(header, cells, strict=True))
        degrees = [_degrees_c(where, name, row[name]) for name in columns]
        if degrees != sorted(degrees):
            raise PomonaError(f"{where}: found min_c {degrees[0]:g} above max_c {degrees[1]:g}, expected it below")
        yield where, _day(where, row["date"]), float(np.mean(degrees))


def _day(where: str, cell: str) -> date:
    try:
        return date.fromisoformat(cell.strip())
    except ValueError:
        expected = expected_day(cell, "a day as 2024-08-09")
        raise PomonaError(f"{where}: date: found {shown(cell)}, {expected}") from None


def _degrees_c(where: str, name: str, cell: str) -> float:
    value, (low, high) = number_in(where, name, cell), PLAUSIBLE_C
    if not low <= value <= high:
        raise PomonaError(f"{where}: {name}: found {value:g}, expected degrees Celsius from {low:g} to {high:g}")
    return value


def _share_of_day(moment: datetime) -> float:
    return (moment - datetime.combine(moment.date(), datetime.min.time())) / timedelta(days=1)
