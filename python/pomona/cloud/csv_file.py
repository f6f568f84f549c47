"""Fruit clouds as CSV: a header with x,y,z in metres, optional columns, others kept."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.cloud.columns import (
    BLANKABLE,
    COVARIANCE,
    MOST_WHOLE,
    NUMBERS,
    WHOLE,
    are_diameters,
    assemble,
    check_names,
    columns_for_file,
    covariances_of,
    number,
)
from pomona.cloud.covariances import are_covariances
from pomona.csv_rows import write_rows
from pomona.errors import PomonaError
from pomona.reading import require_file, shown

if TYPE_CHECKING:
    from pomona.cloud.fruit_cloud import FruitCloud

__all__ = ["read", "write"]

ENCODING = "utf-8-sig"  # spreadsheets put a byte order mark in front


def read(path: Path, make: type[FruitCloud]) -> FruitCloud:
    """Read a cloud; see `FruitCloud.read`.

    The whole table goes through numpy's reader; when that stumbles, a reader of cells takes over, which knows the
    line and column of what is wrong and takes what numpy does not, as a blank diameter.
    """
    with _opened(path) as file:
        names, header_lines = _header(path, file)
    with _opened(path) as file:
        columns = _read_table(file, names, header_lines)
    if columns is None:
        with _opened(path) as file:
            columns = _read_cells(path, file, names, header_lines)
    try:
        return assemble(columns, make)
    except PomonaError as error:
        raise PomonaError(f"{path}: {error}") from None


def write(path: Path, cloud: FruitCloud) -> None:
    """Write a cloud in metres; numbers in the fewest digits that read back the same, unknown diameters blank."""
    columns = columns_for_file(path, cloud)
    rows = zip(*(_cells(name, column) for name, column in columns.items()), strict=True)
    with whole_file(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        write_rows(file, chain([columns], rows))


def _cells(name: str, column: Any) -> list[Any]:
    cells = list(column) if isinstance(column, tuple) else column.tolist()
    return ["" if cell != cell else cell for cell in cells] if name in BLANKABLE else cells


@contextmanager
def _opened(path: Path) -> Iterator[IO[str]]:
    """Open the file for the csv module; what cannot be read as text is one line too."""
    require_file(path, "a fruit cloud: a header with x,y,z")
    try:
        with path.open(newline="", encoding=ENCODING) as file:
            yield file
    except OSError as error:
        raise PomonaError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise PomonaError(f"{path}: byte {error.start} is not UTF-8, expected a text file") from None
    except csv.Error as error:
        raise PomonaError(f"{path}: is not CSV: {error}") from None


def _header(path: Path, file: IO[str]) -> tuple[list[str], int]:
    """Return the names of the columns and the number of lines they take."""
    reader = csv.reader(file)
    names = next((row for row in reader if any(cell.strip() for cell in row)), None)
    if names is None:
        raise PomonaError(f"{path}: the file is empty, expected a header with x,y,z")
    names = [name.strip() for name in names]
    check_names(names, f"{path}: line {reader.line_num}")
    return names, reader.line_num


def _read_table(file: IO[str], names: list[str], header_lines: int) -> dict[str, Any] | None:
    """Read all rows at numpy's speed; None when there is a cell to look at more closely."""
    kinds: dict[str, Any] = {name: np.float64 if name in NUMBERS else object for name in names}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "loadtxt: input contained no data")
        try:
            table = np.loadtxt(
                file,
                dtype=[(f"f{i}", kind) for i, kind in enumerate(kinds.values())],
                delimiter=",",
                quotechar='"',
                comments=None,
                skiprows=header_lines,
                ndmin=1,
            )
        except ValueError:
            return None
    columns = {name: table[f"f{i}"] for i, name in enumerate(names)}
    for name in NUMBERS & columns.keys():
        finite = np.isfinite(columns[name]) | (np.isnan(columns[name]) if name in BLANKABLE else False)
        possible = are_diameters(columns[name]) if name == "diameter_m" else np.True_
        whole = _whole(columns[name]) if name in WHOLE else np.True_
        if not np.all(finite & possible & whole):
            return None
    if "id" in columns and not _names_each_once(columns["id"]):
        return None
    covariances = covariances_of(columns)
    if covariances is not None and not are_covariances(covariances).all():
        return None
    return columns


def _whole(column: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.asarray((column == np.rint(column)) & (column >= 0) & (column <= MOST_WHOLE))


def _names_each_once(ids: Any) -> bool:
    return "" not in (unique := set(ids)) and len(unique) == len(ids)


def _read_cells(path: Path, file: IO[str], names: list[str], header_lines: int) -> dict[str, Any]:
    """Read cell by cell; the first wrong one is the error."""
    reader = csv.reader(file)
    while reader.line_num < header_lines:
        next(reader)
    columns: dict[str, list[Any]] = {name: [] for name in names}
    lines: list[int] = []
    line_of_id: dict[str, int] = {}
    for row, cells in enumerate(cells for cells in reader if not _blank(cells)):
        line = f"{path}: line {reader.line_num}"
        if len(cells) != len(names):
            raise PomonaError(f"{line}: found {len(cells)} cells, expected {len(names)} as in the header")
        for name, cell in zip(names, cells, strict=True):
            try:
                columns[name].append(number(name, cell) if name in NUMBERS else cell)
            except ValueError as error:
                raise PomonaError(f"{line} (row {row}), column {name}: found {shown(cell)}, {error}") from None
        lines.append(reader.line_num)
        if "id" in columns:
            _require_new(columns["id"][-1], line_of_id, reader.line_num, line)
    table: dict[str, Any] = {name: np.array(cells) if name in NUMBERS else cells for name, cells in columns.items()}
    _require_covariances(path, table, lines)
    return table


def _require_covariances(path: Path, columns: dict[str, Any], lines: list[int]) -> None:
    """Refuse numbers that are no covariance together, though each may be one's; `lines` are those of the rows."""
    covariances = covariances_of(columns)
    right = np.array([]) if covariances is None else are_covariances(covariances)
    if not right.all():
        row = int(np.argmin(right))
        where = f"{path}: line {lines[row]} (row {row}), columns {','.join(COVARIANCE)}"
        raise PomonaError(f"{where}: found a matrix that is not positive semi-definite, expected a covariance")


def _blank(cells: list[str]) -> bool:
    return not cells or (len(cells) == 1 and not cells[0].strip())


def _require_new(name: str, line_of_id: dict[str, int], line_number: int, line: str) -> None:
    if not name:
        raise PomonaError(f"{line}, column id: found nothing, expected a name for every fruit or no column id")
    if name in line_of_id:
        found = f"{shown(name)} as in line {line_of_id[name]}"
        raise PomonaError(f"{line}, column id: found {found}, expected each id once")
    line_of_id[name] = line_number
