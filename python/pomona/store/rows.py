"""Rows out of a file: every cell that Pomona reads comes through here, and is what its column may hold."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from pomona.store.cells import COLUMNS
from pomona.store.failures import WrongContentError

__all__ = ["columns_of", "misfits", "one_of", "parsed_column"]

LEAST_ROW_BYTES = 8
"""No row of ours is stored in less; so a file of a megabyte has no more than 131,072 rows to give."""

ROWS_AT_ONCE = 512
"""Fewer than Python's collector lets live before it looks for cycles among them, all modules next to them."""

MAX_SHOWN = 60
"""Characters of a wrong cell that a line shows."""


def columns_of(connection: sqlite3.Connection, table: str, names: Sequence[str], which: str = "") -> list[list[Any]]:
    """Return columns of a table, each cell of the kind that its column holds.

    Parameters
    ----------
    connection : sqlite3.Connection
        A file whose schema is known to be ours.
    table : str
        One of `COLUMNS`.
    names : sequence of str
        Its columns.
    which : str
        SQL after the table's name that chooses and orders rows, each at most once; by ``id`` otherwise.

    Raises
    ------
    WrongContentError
        With the first wrong cell: table, id, column, what was found and what was expected.
    """
    read: list[list[Any]] = [[] for _ in ("id", *names)]
    for part in _fetched(connection, table, ("id", *names), which):
        for column, cells in zip(read, part, strict=True):
            column.extend(cells)
    ids, *columns = read
    for name, cells in zip(("id", *names), (ids, *columns), strict=True):
        for line in _misfits(table, name, ids, cells):
            raise WrongContentError(line)
    return columns


def parsed_column(connection: sqlite3.Connection, table: str, name: str, which: str) -> list[Any]:
    """Return what the texts of a column of JSON say, each looked at once; otherwise as `columns_of`."""
    parse = COLUMNS[table][name].parse
    assert parse is not None
    parsed: list[Any] = []
    for ids, cells in _fetched(connection, table, ("id", name), which):
        read = [parse(cell) if type(cell) is str else None for cell in cells]
        if any(one is None for one in read):
            raise WrongContentError(next(_misfits(table, name, ids, cells)))
        parsed.extend(read)
    return parsed


def one_of(column: str, ids: Iterable[int]) -> str:
    """Return what chooses for `columns_of` the rows whose column is one of these, in order of their ids."""
    return f"WHERE {column} IN ({', '.join(f'{one:d}' for one in ids)}) ORDER BY 1"


def misfits(connection: sqlite3.Connection, table: str) -> list[str]:
    """Return a line for every wrong cell of a table."""
    return [
        line
        for ids, *columns in _fetched(connection, table, ("id", *COLUMNS[table]), "")
        for name, cells in zip(COLUMNS[table], columns, strict=True)
        for line in _misfits(table, name, ids, cells)
    ]


def _misfits(table: str, name: str, ids: Sequence[object], cells: Sequence[object]) -> Iterator[str]:
    kind = COLUMNS[table][name]
    for row in kind.wrong_rows(cells):
        yield f"{table} {_shown(ids[row])}: {name}: found {_shown(cells[row])}, expected {kind.expected}"


def _fetched(
    connection: sqlite3.Connection, table: str, names: Sequence[str], which: str
) -> Iterator[list[Sequence[Any]]]:
    """Give columns as they are, part by part, no more than the file holds: damaged pages can give rows without end."""
    left = _size_bytes(connection)
    wanted = ", ".join(f"{table}.{name}" for name in names)
    cursor = connection.execute(f"SELECT {wanted} FROM {table} {which or f'ORDER BY {table}.id'}")
    while rows := cursor.fetchmany(ROWS_AT_ONCE):
        part: list[Sequence[Any]] = list(zip(*rows, strict=True))
        left -= LEAST_ROW_BYTES * len(rows) + sum(map(_length, part))
        if left < 0:
            raise WrongContentError(f"{table}: gives more rows than the file can hold: it is damaged, or was made to")
        yield part


def _length(cells: Sequence[Any]) -> int:
    """Return how many characters and bytes there are in texts and blobs; numbers have none."""
    types = set(map(type, cells))
    if types.isdisjoint((str, bytes)):
        return 0
    return sum(map(len, cells if types <= {str, bytes} else [cell for cell in cells if type(cell) in (str, bytes)]))


def _size_bytes(connection: sqlite3.Connection) -> int:
    (pages,), (page_bytes,) = (connection.execute(f"PRAGMA page_{what}").fetchone() for what in ("count", "size"))
    return int(pages * page_bytes)


def _shown(cell: object) -> str:
    text = repr(cell)
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}..."
