"""Points as a Shapefile: five files that every GIS opens.

Source: ESRI Shapefile Technical Description (1998); dBASE III for the table, in UTF-8 as the ``.cpg`` says.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.errors import PomonaError
from pomona.geopackage import LOCAL_METRES
from pomona.streams import is_stream

__all__ = ["PARTS", "WGS84_TEXT", "parts_of", "write_shapefile"]

WGS84_TEXT = (
    'GEOGCS["GCS_WGS_1984",DATUM["D_WGS_1984",SPHEROID["WGS_1984",6378137.0,298.257223563]],'
    'PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]]'
)
"""Longitude and latitude as Shapefiles say it."""

PARTS = (".shx", ".dbf", ".prj", ".cpg", ".shp")
"""In the order in which they are written: the one that is opened comes last."""

_POINT_Z = 11
_HEADER_BYTES, _RECORD_BYTES = 100, 44
_MOST_TEXT_BYTES, _MOST_NAME_BYTES = 254, 10
_WHOLE_BYTES, _FLOATING_BYTES = 18, 24
"""Whole numbers of up to 18 digits are taken for those, wider ones for floating."""

_NO_MEASURE = -1e39
"""A point has a place for a measure too; below -1e38 it has none."""

_DATE = bytes([80, 1, 1])
"""Of the table, always the same: the same input gives the same files."""


def parts_of(path: Path) -> tuple[Path, ...]:
    """All files of a Shapefile that is called by its ``.shp``."""
    return tuple(path.with_suffix(part) for part in PARTS)


def write_shapefile(
    path: Path, positions_m: NDArray[np.float64], columns: Mapping[str, Sequence[Any]], system: str = LOCAL_METRES
) -> None:
    """Write points with their columns; each file appears whole or not at all.

    Parameters
    ----------
    path : Path
        Ends in ``.shp``; the other files lie beside it.
    positions_m : (N, 3) float64
    columns : mapping of str to N int, float or str
        None for unknown. Names are cut to ten bytes, text to 254.
    system : str
        The reference system as well-known text; local metres otherwise.

    Raises
    ------
    PomonaError
        When the path has another suffix or is a pipe, or a file cannot be written.
    """
    if is_stream(path) or path.suffix.lower() != ".shp":
        raise PomonaError(f"{path}: a Shapefile is five files, expected a name that ends in .shp")
    contents = {
        ".shx": _header(positions_m, _HEADER_BYTES + 8 * len(positions_m)) + _index(len(positions_m)),
        ".dbf": _table(columns, len(positions_m)),
        ".prj": system.encode(),
        ".cpg": b"UTF-8",
        ".shp": _header(positions_m, _HEADER_BYTES + _RECORD_BYTES * len(positions_m)) + _records(positions_m),
    }
    for part in PARTS:
        with whole_file(path.with_suffix(part)) as partial:
            partial.write_bytes(contents[part])


def _header(positions_m: NDArray[np.float64], n_bytes: int) -> bytes:
    low, high = (positions_m.min(axis=0), positions_m.max(axis=0)) if len(positions_m) else (np.zeros(3), np.zeros(3))
    bounds = (*low[:2], *high[:2], low[2], high[2], 0.0, 0.0)
    return struct.pack(">7i", 9994, 0, 0, 0, 0, 0, n_bytes // 2) + struct.pack("<2i8d", 1000, _POINT_Z, *bounds)


def _index(n: int) -> bytes:
    rows = np.empty((n, 2), dtype=">i4")
    rows[:, 0] = (_HEADER_BYTES + _RECORD_BYTES * np.arange(n)) // 2
    rows[:, 1] = (_RECORD_BYTES - 8) // 2
    return rows.tobytes()


def _records(positions_m: NDArray[np.float64]) -> bytes:
    layout = [("number", ">i4"), ("length", ">i4"), ("kind", "<i4"), ("xyz", "<f8", 3), ("measure", "<f8")]
    rows = np.zeros(len(positions_m), dtype=layout)
    rows["number"], rows["length"] = np.arange(len(rows)) + 1, (_RECORD_BYTES - 8) // 2
    rows["kind"], rows["xyz"], rows["measure"] = _POINT_Z, positions_m, _NO_MEASURE
    return rows.tobytes()


def _table(columns: Mapping[str, Sequence[Any]], n: int) -> bytes:
    fields = [_field(name, cells) for name, cells in zip(_short_names(columns), columns.values(), strict=True)]
    row_bytes = 1 + sum(width for _, width, _ in fields)
    head_bytes = 33 + 32 * len(fields)
    head = b"\x03" + _DATE + struct.pack("<IHH20x", n, head_bytes, row_bytes)
    rows = (b" " + b"".join(cells) for cells in zip(*(cells for _, _, cells in fields), strict=True))
    return head + b"".join(described for described, _, _ in fields) + b"\r" + b"".join(rows) + b"\x1a"


def _field(name: bytes, cells: Sequence[Any]) -> tuple[bytes, int, list[bytes]]:
    """Describe a column, and give its width and its cells in that width."""
    known = [cell for cell in cells if cell is not None]
    if known and all(isinstance(cell, int) and abs(cell) < 10 ** (_WHOLE_BYTES - 1) for cell in known):
        kind, width, decimals = b"N", _WHOLE_BYTES, 0
        texts = [b"" if cell is None else f"{cell:d}".encode() for cell in cells]
    elif known and all(isinstance(cell, int | float) for cell in known):
        kind, width, decimals = b"F", _FLOATING_BYTES, 15
        texts = [b"" if cell is None else f"{cell:.15g}".encode() for cell in cells]
    else:
        kind, decimals = b"C", 0
        texts = [b"" if cell is None else _cut(str(cell), _MOST_TEXT_BYTES) for cell in cells]
        width = max(1, *map(len, texts), 1)
    aligned = [text.ljust(width) if kind == b"C" else text.rjust(width) for text in texts]
    return struct.pack("<11sc4xBB14x", name, kind, width, decimals), width, aligned


def _short_names(columns: Mapping[str, Sequence[Any]]) -> Iterator[bytes]:
    """Names of ten bytes at most, each once: a number takes the end of one that is there already."""
    taken: set[bytes] = set()
    for name in columns:
        short, number = _cut(name, _MOST_NAME_BYTES) or b"column", 1
        while short.upper() in taken:
            number += 1
            short = _cut(name, _MOST_NAME_BYTES - len(str(number))) + str(number).encode()
        taken.add(short.upper())
        yield short


def _cut(text: str, most_bytes: int) -> bytes:
    """Encode a text without its NULs, cut between characters."""
    return text.replace("\0", "").encode()[:most_bytes].decode("utf-8", "ignore").encode()
