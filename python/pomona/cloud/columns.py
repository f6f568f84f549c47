"""The columns of a fruit cloud's file, the same names in CSV and PLY."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pomona.cloud.typed import as_whole, typed
from pomona.errors import PomonaError
from pomona.reading import shown

if TYPE_CHECKING:
    from pomona.cloud.fruit_cloud import FruitCloud

__all__ = [
    "BLANKABLE",
    "LARGEST_DIAMETER_M",
    "MOST_WHOLE",
    "NUMBERS",
    "WHOLE",
    "are_diameters",
    "assemble",
    "check_names",
    "columns_for_file",
    "covariances_of",
    "number",
    "split",
    "typed_columns",
]

POSITION = ("x", "y", "z")
COVARIANCE = ("cxx", "cyy", "czz", "cxy", "cxz", "cyz")
COVARIANCE_CELLS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))

NUMBERS = frozenset({*POSITION, "diameter_m", *COVARIANCE, "n_views"})
"""Columns that hold numbers; every other column is text."""

WHOLE = frozenset({"n_views"})
"""Columns that hold whole numbers."""

BLANKABLE = frozenset({"diameter_m"})
"""Columns in which an empty cell means unknown."""

LARGEST_DIAMETER_M = 1.0
"""Metres; no tree bears larger fruits. Beyond it the column is in another unit."""

MOST_COLUMNS = 1000
"""Of a file; each costs time in every row, and a table of measurements has some ten."""

MOST_WHOLE = 2**53
"""Largest whole number: beyond it a double no longer tells neighbours apart."""


def check_names(names: Sequence[str], where: str) -> None:
    """Refuse a header that lacks a coordinate, names a column twice or has only a part of the covariance."""
    missing = [name for name in POSITION if name not in names]
    if missing:
        found = shown(",".join(names))
        raise PomonaError(
            f"{where}: found columns {found} without {','.join(missing)}, expected at least x,y,z{_hint(names)}"
        )
    if len(names) > MOST_COLUMNS:
        raise PomonaError(f"{where}: found {len(names)} columns, expected at most {MOST_COLUMNS}")
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise PomonaError(f"{where}: column {shown(twice)} is there twice, expected each name once")
    lacking = [name for name in COVARIANCE if name not in names]
    if 0 < len(lacking) < len(COVARIANCE):
        raise PomonaError(f"{where}: found a covariance without {','.join(lacking)}, expected {','.join(COVARIANCE)}")


def number(name: str, cell: str, *, is_whole: bool = False) -> float:
    """Read one cell of a column of numbers; `is_whole` where the file takes whole ones alone.

    Raises
    ------
    ValueError
        With what was expected instead.
    """
    if name in BLANKABLE and cell.strip() in ("", "nan"):
        return math.nan
    try:
        value = float(cell)
    except ValueError:
        raise ValueError("expected a number") from None
    if "_" in cell:  # Python reads 1_000 as a number, nobody else does
        raise ValueError("expected a number")
    if not math.isfinite(value):
        raise ValueError("expected a finite number")
    if (is_whole or name in WHOLE) and (not value.is_integer() or abs(value) > MOST_WHOLE):
        raise ValueError("expected a whole number")
    if name in WHOLE and value < 0:
        raise ValueError("expected 0 or more")
    if name == "diameter_m" and value <= 0:
        raise ValueError("expected a positive number or nothing")
    if name == "diameter_m" and value > LARGEST_DIAMETER_M:
        raise ValueError(f"expected at most {LARGEST_DIAMETER_M:g} m or nothing")
    return value


def are_diameters(metres: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which of a column, (N,), a fruit may have, or are unknown."""
    return np.asarray(np.isnan(metres) | ((metres > 0) & (metres <= LARGEST_DIAMETER_M)))


def covariances_of(columns: Mapping[str, Any]) -> NDArray[np.float64] | None:
    """Put the columns of a covariance together, (N, 3, 3); None where there are none."""
    if COVARIANCE[0] not in columns:
        return None
    covariances = np.empty((len(columns["x"]), 3, 3))
    for name, (i, j) in zip(COVARIANCE, COVARIANCE_CELLS, strict=True):
        covariances[:, i, j] = covariances[:, j, i] = columns[name]
    return covariances


def assemble(columns: Mapping[str, Any], make: type[FruitCloud]) -> FruitCloud:
    """Put columns together as a cloud; numbers as arrays, text as sequences of str."""
    return make(
        positions=np.column_stack([columns[name] for name in POSITION]).astype(np.float64),
        ids=tuple(columns["id"]) if "id" in columns else None,
        diameters_m=columns.get("diameter_m"),
        covariances=covariances_of(columns),
        n_views=np.asarray(columns["n_views"]).astype(np.int64) if "n_views" in columns else None,
        extras={name: tuple(column) for name, column in columns.items() if name not in NUMBERS and name != "id"},
    )


def split(cloud: FruitCloud) -> dict[str, Any]:
    """Take a cloud apart into the columns of its file, in order; the inverse of `assemble`."""
    columns: dict[str, Any] = {}
    if cloud.ids is not None:
        columns["id"] = cloud.ids
    columns.update(zip(POSITION, cloud.positions.T, strict=True))
    if cloud.diameters_m is not None:
        columns["diameter_m"] = cloud.diameters_m
    if cloud.covariances is not None:
        for name, (i, j) in zip(COVARIANCE, COVARIANCE_CELLS, strict=True):
            columns[name] = cloud.covariances[:, i, j]
    if cloud.n_views is not None:
        columns["n_views"] = cloud.n_views
    for name, column in cloud.extras.items():
        if name in NUMBERS or name == "id":
            raise PomonaError(f"extras: found the name {name!r}, expected one that no column of ours has")
        columns[name] = column
    return columns


def columns_for_file(path: Path, cloud: FruitCloud) -> dict[str, Any]:
    """Take a cloud apart as `split` does, and refuse names that a reader would not tell apart: it strips them."""
    columns = split(cloud)
    check_names([name.strip() for name in columns], str(path))
    return columns


def typed_columns(cloud: FruitCloud) -> dict[str, Any]:
    """Take a cloud apart as `split` does, text that is numbers as numbers; an id stays the name that it is.

    Ids become numbers only where all are whole and none is written in another way.
    """
    columns = {
        name: column if isinstance(column, np.ndarray) else typed(column) for name, column in split(cloud).items()
    }
    if cloud.ids is not None:
        columns["id"] = as_whole(cloud.ids) or list(cloud.ids)
    return columns


def _hint(names: Sequence[str]) -> str:
    """Say what the usual mistakes of a header are, where it is one of these."""
    separator = next((mark for mark in (";", "\t") if any(mark in name for name in names)), None)
    if separator is not None:
        return f", separated by commas and not by {'semicolons' if separator == ';' else 'tabs'}, with decimal points"
    return ", in small letters" if {name.lower() for name in names} >= set(POSITION) else ""
