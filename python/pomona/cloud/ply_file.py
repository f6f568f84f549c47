"""Fruit clouds as PLY, ascii or binary, with the property names of the CSV columns.

PLY has no text. Names and other text go into comments, one a fruit, which other programs skip:
``comment text COLUMN ROW "VALUE"`` with the value as JSON. Ids that are plain whole numbers are a property ``id``.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.cloud.columns import (
    LARGEST_DIAMETER_M,
    MOST_WHOLE,
    NUMBERS,
    WHOLE,
    are_diameters,
    assemble,
    check_names,
    columns_for_file,
    number,
)
from pomona.cloud.typed import as_floats, as_whole
from pomona.errors import PomonaError
from pomona.likes import PLY_MARK
from pomona.reading import parsed_json, require_file, shown, whole_number
from pomona.unicode_text import UNICODE, broken_at

if TYPE_CHECKING:
    from pomona.cloud.fruit_cloud import FruitCloud

__all__ = ["read", "write"]

NAMES_OF_SCALARS = {
    "i1": ("char", "int8"),
    "u1": ("uchar", "uint8"),
    "i2": ("short", "int16"),
    "u2": ("ushort", "uint16"),
    "i4": ("int", "int32"),
    "u4": ("uint", "uint32"),
    "f4": ("float", "float32"),
    "f8": ("double", "float64"),
}
SCALARS = {name: scalar for scalar, names in NAMES_OF_SCALARS.items() for name in names}
BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
MAX_HEADER_LINE = 65_536


@dataclass(frozen=True)
class Header:
    """What stands before the points."""

    byte_order: str  # "" for ascii
    n_vertices: int
    fields: list[tuple[str, str]]  # property name and numpy scalar
    texts: dict[str, dict[int, str]]  # column -> row -> value
    n_lines: int


def read(path: Path, make: type[FruitCloud]) -> FruitCloud:
    """Read a cloud; see `FruitCloud.read`."""
    require_file(path, "a fruit cloud in PLY")
    try:
        with path.open("rb") as file:
            header = _read_header(path, file)
            table = _read_ascii(path, file, header) if not header.byte_order else _read_binary(path, file, header)
    except OSError as error:
        raise PomonaError(f"{path}: cannot be read: {error.strerror}") from None
    columns: dict[str, Any] = {}
    for name, _ in header.fields:
        _require_good(path, name, table[name])
        columns[name] = table[name] if name in NUMBERS else [_text(value) for value in table[name].tolist()]
    columns.update((column, _complete(path, column, values, header)) for column, values in header.texts.items())
    try:
        return assemble(columns, make)
    except PomonaError as error:
        raise PomonaError(f"{path}: {error}") from None


def write(path: Path, cloud: FruitCloud) -> None:
    """Write a cloud in metres, binary; coordinates as doubles, so that they read back the same."""
    arrays: dict[str, NDArray[Any]] = {}
    comments: list[str] = []
    for name, column in columns_for_file(path, cloud).items():
        numbers = column if isinstance(column, np.ndarray) else _as_numbers(column, whole=name == "id")
        if numbers is None:
            comments += [_comment(path, name, row, cell) for row, cell in enumerate(column)]
        else:
            arrays[_word(path, name)] = numbers.astype("<i4" if _fits_int(numbers) else "<f8")
    table = np.zeros(len(cloud), dtype=[(name, array.dtype) for name, array in arrays.items()])
    for name, array in arrays.items():
        table[name] = array
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        PLY_MARK,
        *comments,
        f"element vertex {len(table)}",
        *(f"property {'int' if array.dtype.kind == 'i' else 'double'} {name}" for name, array in arrays.items()),
        "end_header",
    ]
    with whole_file(path) as partial, partial.open("wb") as file:
        file.write(("\n".join(lines) + "\n").encode("ascii"))
        file.write(table.tobytes())


def _as_numbers(cells: tuple[str, ...], *, whole: bool) -> NDArray[np.int32] | NDArray[np.float64] | None:
    """Return text that is nothing but numbers as such: of 32 bits where all are whole, else doubles with nan for none.

    Whole numbers read back as they were written, others as the same number; ids must be whole. None is for text.
    """
    integers = as_whole(cells)
    if integers is not None and all(number is not None and abs(number) < 2**31 for number in integers):
        return np.array(integers, dtype=np.int32)
    floats = None if whole or (integers is not None and None not in integers) else as_floats(cells)
    return None if floats is None else np.array(floats, dtype=np.float64)


def _fits_int(numbers: NDArray[Any]) -> bool:
    """Tell whether numbers are whole and of the 32 bits that PLY has."""
    return numbers.dtype.kind == "i" and bool((np.abs(numbers) < 2**31).all())


def _comment(path: Path, name: str, row: int, cell: str) -> str:
    line = f"comment text {_word(path, name)} {row} {json.dumps(cell)}"
    if len(line) >= MAX_HEADER_LINE:
        found = f"a text of {len(cell)} characters"
        raise PomonaError(f"{path}: column {name}, row {row}: found {found}, expected less, or a CSV")
    return line


def _word(path: Path, name: str) -> str:
    if not (name.isascii() and name.isprintable() and name and " " not in name):
        raise PomonaError(f"{path}: column {name!r} cannot be named in a PLY header, expected ASCII without blanks")
    return name


def _text(value: float) -> str:
    if isinstance(value, int):
        return str(value)
    return "" if np.isnan(value) else repr(value)


def _read_header(path: Path, file: IO[bytes]) -> Header:
    if file.readline(MAX_HEADER_LINE).strip() != b"ply":
        raise PomonaError(f"{path}: line 1: is not a PLY file, expected 'ply'")
    byte_order: str | None = None
    elements: list[tuple[str, int]] = []
    fields: list[tuple[str, str]] = []
    texts: dict[str, dict[int, str]] = {}
    line_number = 1
    while True:
        raw = file.readline(MAX_HEADER_LINE)
        line_number += 1
        where = f"{path}: line {line_number}"
        line = raw.decode("ascii", "replace").strip()
        if not raw:
            raise PomonaError(f"{where}: the file ends inside the header, expected 'end_header'")
        if len(raw) == MAX_HEADER_LINE and not raw.endswith(b"\n"):  # or its rest would be a line of its own
            raise PomonaError(f"{where}: found a line of more than {MAX_HEADER_LINE} bytes, expected a PLY header")
        match line.split(maxsplit=4):
            case ["end_header"]:
                break
            case ["format", kind, *_] if kind in BYTE_ORDERS:
                byte_order = BYTE_ORDERS[kind]
            case ["element", name, count]:
                elements.append((name, _count(where, count)))
            case ["property", kind, name] if kind in SCALARS and elements:
                if elements[-1][0] == "vertex":
                    fields.append((name, SCALARS[kind]))
            case ["property", "list", *_] if elements and elements[-1][0] != "vertex":
                pass  # faces and the like follow the points and are not read
            case ["comment", "text", column, row, value] if column not in NUMBERS:
                texts.setdefault(column, {})[_count(where, row)] = _json_text(where, value)
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise PomonaError(f"{where}: found {line[:60]!r}, expected a PLY header with scalar vertex properties")
    if byte_order is None or not elements or elements[0][0] != "vertex":
        raise PomonaError(f"{path}: expected a format line and 'element vertex' as the first element")
    check_names([*(name for name, _ in fields), *texts], f"{path}: header")
    return Header(byte_order, elements[0][1], fields, texts, line_number)


def _count(where: str, text: str) -> int:
    count = whole_number(where, text, "a count")
    if count < 0:
        raise PomonaError(f"{where}: found {count}, expected a count")
    return count


def _json_text(where: str, value: str) -> str:
    try:
        text = parsed_json(where, value, "a quoted text")
    except PomonaError:
        text = None
    if not isinstance(text, str):
        raise PomonaError(f"{where}: found {shown(value)}, expected a quoted text")
    if broken_at([text]) is not None:
        raise PomonaError(f"{where}: found {shown(text)}, expected {UNICODE}")
    return text


def _complete(path: Path, column: str, values: dict[int, str], header: Header) -> list[str]:
    if sorted(values) != list(range(header.n_vertices)):
        found = len(values)
        raise PomonaError(
            f"{path}: comments name {column} of {found} fruits, expected {header.n_vertices}, one a fruit"
        )
    return [values[row] for row in range(header.n_vertices)]


def _read_binary(path: Path, file: IO[bytes], header: Header) -> NDArray[Any]:
    row = np.dtype([(name, header.byte_order + scalar) for name, scalar in header.fields])
    wanted = row.itemsize * header.n_vertices
    there = os.fstat(file.fileno()).st_size - file.tell()
    if there < wanted:
        raise PomonaError(f"{path}: the file ends after {there // row.itemsize} vertices, expected {header.n_vertices}")
    content = file.read(wanted)
    return np.frombuffer(content, dtype=row)


def _read_ascii(path: Path, file: IO[bytes], header: Header) -> NDArray[Any]:
    lines = [line for _, line in zip(range(header.n_vertices), file, strict=False)]
    if len(lines) < header.n_vertices:
        raise PomonaError(f"{path}: the file ends after {len(lines)} vertices, expected {header.n_vertices}")
    # Doubles hold every scalar of PLY exactly.
    row = np.dtype([(name, "i8" if scalar[0] in "iu" else "f8") for name, scalar in header.fields])
    if not lines:
        return np.empty(0, row)
    try:
        return np.loadtxt(lines, dtype=row, comments=None, ndmin=1, encoding="ascii")
    except ValueError:
        raise _first_wrong_cell(path, lines, header) from None


def _first_wrong_cell(path: Path, lines: list[bytes], header: Header) -> PomonaError:
    for row, line in enumerate(lines):
        where = f"{path}: line {header.n_lines + 1 + row} (row {row})"
        cells = line.decode("ascii", "replace").split()
        if len(cells) != len(header.fields):
            return PomonaError(f"{where}: found {len(cells)} values, expected {len(header.fields)} as in the header")
        for (name, scalar), cell in zip(header.fields, cells, strict=True):
            try:
                number(name, cell, is_whole=scalar[0] in "iu")
            except ValueError as error:
                return PomonaError(f"{where}, property {name}: found {shown(cell)}, {error}")
    return PomonaError(f"{path}: the vertices cannot be read as numbers")


def _require_good(path: Path, name: str, values: NDArray[Any]) -> None:
    if name not in NUMBERS:
        return
    if name == "diameter_m":
        wrong = ~are_diameters(values)
        wanted = f"a positive number or nan, at most {LARGEST_DIAMETER_M:g} m"
    elif name in WHOLE:
        wrong, wanted = (values != np.rint(values)) | (values < 0) | (values > MOST_WHOLE), "a whole number, 0 or more"
    else:
        wrong, wanted = ~np.isfinite(values), "a finite number"
    if wrong.any():
        row = int(np.argmax(wrong))
        raise PomonaError(f"{path}: row {row}, property {name}: found {values[row]}, expected {wanted}")
