"""Known points out of a table: places in the map, or moments of a session, with where they are on Earth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.earth import are_outside_zone, from_utm
from pomona.errors import PomonaError
from pomona.reading import number_in, shown
from pomona.table_lines import table_lines

__all__ = ["ControlTable", "read_control_points"]

_PLACES = (("x", "y", "z"), ("frame",), ("time",))
_EARTH = (("lon", "lat"), ("easting", "northing"))
_EXPECTED = "x,y,z (or frame, or time of a session) and lon,lat or easting,northing; name and height where known"


@dataclass(frozen=True, eq=False)
class ControlTable:
    """Known points as the table has them.

    Attributes
    ----------
    path : Path
    where : tuple of N str
        File and line of each.
    names : tuple of N str
    place : {"x", "frame", "time"}
        By what the places in the map are told.
    places : (N, 3) or (N, 1) float64
        In the map, metres; or frames, or times in seconds.
    geodetic : (N, 3) float64
        Longitude and latitude in degrees, height in metres; NaN where it is not known.
    """

    path: Path
    where: tuple[str, ...]
    names: tuple[str, ...]
    place: str
    places: NDArray[np.float64]
    geodetic: NDArray[np.float64]


def read_control_points(path: Path, epsg: int | None = None) -> ControlTable:
    """Read a table of known points.

    Parameters
    ----------
    path : Path
    epsg : int, optional
        UTM zone of the columns easting and northing.

    Raises
    ------
    PomonaError
        One line: columns that are missing or contradict each other, a number that is none, degrees that no place has.
    """
    lines = table_lines(path, _EXPECTED)
    header = [name.strip().lower() for name in next(lines)[1]]
    place, earth = (_only(path, header, choices) for choices in (_PLACES, _EARTH))
    if (earth[0] == "easting") != (epsg is not None):
        found = "columns easting, northing without --epsg" if epsg is None else f"--epsg {epsg} with columns lon, lat"
        raise PomonaError(f"{path}: found {found}, expected both or none")
    where, rows = [], []
    for line, cells in lines:
        where.append(line)
        rows.append(dict(zip(header, cells, strict=True)))
    places = np.array([[number_in(at, name, row[name]) for name in place] for at, row in zip(where, rows, strict=True)])
    plan = np.array([[number_in(at, name, row[name]) for name in earth] for at, row in zip(where, rows, strict=True)])
    if not rows:
        raise PomonaError(f"{path}: found no known points, expected two or more")
    if epsg is not None:
        _require_in_zone(where, epsg, plan)
        plan = from_utm(epsg, plan[:, 0], plan[:, 1])
    _require_degrees(where, plan)
    heights = [
        number_in(at, "height", row["height"]) if row.get("height", "").strip() else np.nan
        for at, row in zip(where, rows, strict=True)
    ]
    return ControlTable(
        path=path,
        where=tuple(where),
        names=tuple(row.get("name", "").strip() or f"point {n}" for n, row in enumerate(rows, 1)),
        place=place[0],
        places=places,
        geodetic=np.column_stack([plan, heights]),
    )


def _only(path: Path, header: list[str], choices: tuple[tuple[str, ...], ...]) -> tuple[str, ...]:
    there = [names for names in choices if all(header.count(name) == 1 for name in names)]
    if len(there) != 1:
        raise PomonaError(f"{path}: found the header {shown(','.join(header))}, expected {_EXPECTED}")
    return there[0]


def _require_in_zone(where: list[str], epsg: int, plan: NDArray[np.float64]) -> None:
    wrong = are_outside_zone(epsg, plan[:, 0], plan[:, 1])
    if wrong.any():
        row = int(np.argmax(wrong))
        found = f"easting {plan[row, 0]:g} and northing {plan[row, 1]:g}"
        raise PomonaError(f"{where[row]}: found {found}, expected metres in the zone of --epsg {epsg}")


def _require_degrees(where: list[str], plan: NDArray[np.float64]) -> None:
    for column, name, most in ((0, "lon", 180.0), (1, "lat", 90.0)):
        wrong = np.abs(plan[:, column]) > most
        if wrong.any():
            row = int(np.argmax(wrong))
            found = f"{plan[row, column]:g}, expected degrees from {-most:g} to {most:g}"
            raise PomonaError(f"{where[row]}: {name}: found {found}")
