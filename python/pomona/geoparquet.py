"""Points as GeoParquet: columns that pandas, DuckDB and QGIS read.

One page a column and row group, plain and uncompressed: no library is needed to write what they all read.
Source: Apache Parquet format 2.10 (parquet.thrift, Encodings.md), Thrift compact protocol, GeoParquet 1.1.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona import __version__
from pomona.atomic import whole_file
from pomona.likes import PARQUET_MARK
from pomona.thrift_compact import ThriftValue, i32, i64, listed, structure, text, varint

__all__ = ["write_geoparquet"]

MAGIC = b"PAR1"

_ROWS_OF_GROUP = 1 << 17
_OPTIONAL, _UTF8 = 1, 0
_PLAIN, _RLE, _UNCOMPRESSED, _DATA_PAGE = 0, 3, 0, 0
_INT64, _DOUBLE, _BYTE_ARRAY = 2, 5, 6

_WKB_POINT_Z = np.dtype([("length", "<u4"), ("order", "u1"), ("kind", "<u4"), ("xyz", "<f8", 3)])


@dataclass(frozen=True, eq=False)
class _Column:
    """A column: its physical type, whether it is text, and its cells, None for unknown."""

    name: str
    kind: int
    is_text: bool
    cells: Sequence[Any]


def write_geoparquet(
    path: Path, positions_m: NDArray[np.float64], columns: Mapping[str, Sequence[Any]], *, on_earth: bool = False
) -> None:
    """Write points with their columns; the file appears whole or not at all.

    Parameters
    ----------
    path : Path
    positions_m : (N, 3) float64
        Become the column ``geometry``, points Z as WKB.
    columns : mapping of str to N int, float or str
        None for unknown; another column called ``geometry`` gets a line below its name.
    on_earth : bool
        Whether they are longitude and latitude in degrees and height; else local metres, without a reference system.
    """
    taken = [_column(f"{name}_" if name == "geometry" else name, cells) for name, cells in columns.items()]
    points = _Column("geometry", _BYTE_ARRAY, False, _points(positions_m))
    everything = [*taken, points]
    with whole_file(path) as partial, partial.open("wb") as file:
        file.write(MAGIC)
        groups = []
        for first in range(0, len(positions_m), _ROWS_OF_GROUP):
            rows = slice(first, min(first + _ROWS_OF_GROUP, len(positions_m)))
            chunks = []
            for column in everything:
                offset, page = file.tell(), _page(column, rows)
                file.write(page)
                chunks.append(_chunk(column, rows.stop - rows.start, offset, len(page)))
            groups.append(_group(chunks, rows.stop - rows.start))
        footer = _footer(everything, groups, positions_m, on_earth)
        file.write(footer + struct.pack("<I", len(footer)) + MAGIC)


def _column(name: str, cells: Sequence[Any]) -> _Column:
    known = [cell for cell in cells if cell is not None]
    if known and all(isinstance(cell, int) for cell in known):
        return _Column(name, _INT64, False, cells)
    if known and all(isinstance(cell, int | float) for cell in known):
        return _Column(name, _DOUBLE, False, cells)
    return _Column(name, _BYTE_ARRAY, True, [None if cell is None else str(cell).encode() for cell in cells])


def _points(positions_m: NDArray[np.float64]) -> list[bytes]:
    rows = np.zeros(len(positions_m), dtype=_WKB_POINT_Z)
    rows["order"], rows["kind"], rows["xyz"] = 1, 1001, positions_m
    whole, size = rows.tobytes(), _WKB_POINT_Z.itemsize
    return [whole[start + 4 : start + size] for start in range(0, len(whole), size)]


def _page(column: _Column, rows: slice) -> bytes:
    """Put which cells are known, then those, behind the header of a page."""
    cells = column.cells[rows]
    known = [cell for cell in cells if cell is not None]
    if column.kind == _BYTE_ARRAY:
        values = b"".join(struct.pack("<I", len(cell)) + cell for cell in known)
    else:
        values = np.array(known, dtype="<i8" if column.kind == _INT64 else "<f8").tobytes()
    body = _levels(np.array([cell is not None for cell in cells], dtype=bool)) + values
    about = structure({1: i32(len(cells)), 2: i32(_PLAIN), 3: i32(_RLE), 4: i32(_RLE)})
    return structure({1: i32(_DATA_PAGE), 2: i32(len(body)), 3: i32(len(body)), 5: about}).encoded + body


def _levels(known: NDArray[np.bool_]) -> bytes:
    """One bit a cell, in groups of eight."""
    bits = np.packbits(known, bitorder="little").tobytes()
    run = varint((len(bits) << 1) | 1) + bits
    return struct.pack("<I", len(run)) + run


def _chunk(column: _Column, n_rows: int, offset: int, n_bytes: int) -> ThriftValue:
    about = structure(
        {
            1: i32(column.kind),
            2: listed([i32(_PLAIN), i32(_RLE)]),
            3: listed([text(column.name)]),
            4: i32(_UNCOMPRESSED),
            5: i64(n_rows),
            6: i64(n_bytes),
            7: i64(n_bytes),
            9: i64(offset),
        }
    )
    return structure({2: i64(offset), 3: about})


def _group(chunks: list[ThriftValue], n_rows: int) -> ThriftValue:
    # The size is asked for and used by no reader that is known: a hint.
    return structure({1: listed(chunks), 2: i64(sum(len(chunk.encoded) for chunk in chunks)), 3: i64(n_rows)})


def _footer(
    columns: list[_Column], groups: list[ThriftValue], positions_m: NDArray[np.float64], on_earth: bool
) -> bytes:
    root = structure({4: text("schema"), 5: i32(len(columns))})
    elements = [
        structure(
            {1: i32(column.kind), 3: i32(_OPTIONAL), 4: text(column.name)} | ({6: i32(_UTF8)} if column.is_text else {})
        )
        for column in columns
    ]
    geo = structure({1: text("geo"), 2: text(_geo(positions_m, on_earth))})
    mark = structure({1: text("comment"), 2: text(PARQUET_MARK.decode())})
    return structure(
        {
            1: i32(2),
            2: listed([root, *elements]),
            3: i64(len(positions_m)),
            4: listed(groups),
            5: listed([geo, mark]),
            6: text(f"pomona {__version__}"),
        }
    ).encoded


def _geo(positions_m: NDArray[np.float64], on_earth: bool) -> str:
    """Say what the geometry is; a null reference system means unknown, none at all longitude and latitude."""
    column: dict[str, Any] = {"encoding": "WKB", "geometry_types": ["Point Z"]}
    if not on_earth:
        column["crs"] = None
    if len(positions_m):
        column["bbox"] = [*positions_m.min(axis=0).tolist(), *positions_m.max(axis=0).tolist()]
    return json.dumps({"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": column}})
