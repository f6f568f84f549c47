"""The columns of a cloud that are text: ids, and what else a file said of its fruits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pomona.errors import PomonaError
from pomona.reading import shown
from pomona.unicode_text import UNICODE, broken_at

__all__ = ["checked_extras", "checked_ids"]


def checked_ids(ids: Any, n: int) -> tuple[str, ...]:
    """Return names of N fruits as text.

    Raises
    ------
    PomonaError
        There are more or fewer, one is empty or no text that a file can hold, or two fruits have the same.
    """
    names = _column("ids", ids, n)
    if "" in names:
        raise PomonaError(f"ids: row {names.index('')} is empty, expected a name for every fruit or no ids")
    if len(set(names)) != n:
        raise _twice(names)
    return names


def checked_extras(extras: Any, n: int) -> dict[str, tuple[str, ...]]:
    """Return further columns, each of N cells, as text.

    Raises
    ------
    PomonaError
        They are no mapping, or a name or a cell is no text that a file can hold.
    """
    if not isinstance(extras, Mapping):
        raise PomonaError(f"extras: found {shown(extras)}, expected a mapping of names to columns")
    for name in extras:
        if not isinstance(name, str):
            raise PomonaError(f"extras: found the name {shown(name)}, expected text")
        if broken_at([name]) is not None:
            raise PomonaError(f"extras: found the name {shown(name)}, expected {UNICODE}")
    return {name: _column(name, cells, n) for name, cells in extras.items()}


def _column(name: str, cells: Any, n: int) -> tuple[str, ...]:
    if not isinstance(cells, Iterable):
        raise PomonaError(f"{name}: found {shown(cells)}, expected {n} values, one a fruit")
    column = tuple(str(cell) for cell in cells)
    if len(column) != n:
        raise PomonaError(f"{name}: found {len(column)} values, expected {n}, one a fruit")
    broken = broken_at(column)
    if broken is not None:
        raise PomonaError(f"{name}: row {broken} is {shown(column[broken])}, expected {UNICODE}")
    return column


def _twice(ids: tuple[str, ...]) -> PomonaError:
    first_row: dict[str, int] = {}
    row = next(row for row, name in enumerate(ids) if first_row.setdefault(name, row) != row)
    return PomonaError(f"ids: rows {first_row[ids[row]]} and {row} are both {ids[row]!r}, expected each id once")
