"""Fruits of a session or a map for other programs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from pomona.atomic import whole_file
from pomona.cloud import FruitCloud, csv_file, ply_file
from pomona.cloud.columns import COVARIANCE, COVARIANCE_CELLS, POSITION, typed_columns
from pomona.errors import PomonaError
from pomona.geopackage import LOCAL_METRES
from pomona.geoparquet import write_geoparquet
from pomona.shapefile import write_shapefile

__all__ = ["SUFFIXES", "ExportFormat", "export_cloud", "format_of"]

ExportFormat = Literal["csv", "ply", "geojson", "shp", "parquet"]

SUFFIXES: dict[str, ExportFormat] = {
    ".csv": "csv",
    ".ply": "ply",
    ".geojson": "geojson",
    ".json": "geojson",
    ".shp": "shp",
    ".parquet": "parquet",
}
"""What the name of a file says of its format."""


def export_cloud(cloud: FruitCloud, path: str | Path, to: ExportFormat) -> None:
    """Write fruits with their ids, in metres, in the frame they are in; the file appears whole or not at all.

    Parameters
    ----------
    cloud : FruitCloud
        The fruits, for example ``FruitCloud.read("orchard.gpkg")``.
    path : str or Path
        The file to write; its suffix is yours to choose.
    to : {"csv", "ply", "geojson", "shp", "parquet"}
        Its format. Rows without ids get their row numbers in the last three.
    """
    path = Path(path)
    if to == "csv":
        csv_file.write(path, cloud)
    elif to == "ply":
        ply_file.write(path, cloud)
    elif to == "geojson":
        _write_geojson(path, cloud)
    elif to == "shp":
        write_shapefile(path, cloud.positions, _plain_columns(cloud))
    elif to == "parquet":
        write_geoparquet(path, cloud.positions, _plain_columns(cloud))
    else:
        raise PomonaError(f"--to: found {to!r}, expected one of {', '.join(get_args(ExportFormat))}")


def _write_geojson(path: Path, cloud: FruitCloud) -> None:
    """Write GeoJSON whose coordinates are local metres.

    RFC 7946 knows longitude and latitude only. The specification of 2008, which QGIS and GDAL read, names a coordinate
    system: with ours, programs that know it do not take the metres for degrees, and the others skip the name.
    """
    head = {
        "type": "FeatureCollection",
        "name": path.stem,
        "crs": {"type": "name", "properties": {"name": LOCAL_METRES}},
    }
    columns = _properties(cloud)
    with whole_file(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(json.dumps(head)[:-1] + ', "features": [')
        for row, position in enumerate(cloud.positions.tolist()):
            feature = {
                "type": "Feature",
                "id": columns["id"][row],
                "properties": {name: cells[row] for name, cells in columns.items()},
                "geometry": {"type": "Point", "coordinates": position},
            }
            file.write(("," if row else "") + "\n" + json.dumps(feature, ensure_ascii=False, allow_nan=False))
        file.write("\n]}\n")


def _plain_columns(cloud: FruitCloud) -> dict[str, list[Any]]:
    """Give the columns besides the place, one cell a fruit and column."""
    columns = _columns(cloud)
    if cloud.covariances is not None:
        for name, (i, j) in zip(COVARIANCE, COVARIANCE_CELLS, strict=True):
            columns[name] = cloud.covariances[:, i, j].tolist()
    return columns


def _properties(cloud: FruitCloud) -> dict[str, list[Any]]:
    """Give the columns besides the place as GeoJSON has them: the covariance is one of them."""
    columns = _columns(cloud)
    if cloud.covariances is not None:
        columns["covariance_m2"] = cloud.covariances.tolist()
    return columns


def _columns(cloud: FruitCloud) -> dict[str, list[Any]]:
    """Give the columns besides the place and the covariance, numbers as numbers; None is unknown."""
    columns = typed_columns(cloud)
    lists = {
        name: [None if value != value else value for value in np.asarray(column).tolist()]  # nan is not itself
        if isinstance(column, np.ndarray)
        else column
        for name, column in columns.items()
        if name not in (*POSITION, *COVARIANCE)
    }
    return {"id": list(range(len(cloud))), **lists}


def format_of(path: Path, to: ExportFormat | None) -> ExportFormat:
    """Tell the format of a file that is to be written, by what was said or by its name.

    Raises
    ------
    PomonaError
        When neither tells, or they contradict each other.
    """
    named = SUFFIXES.get(path.suffix.lower())
    if to is not None and named not in (to, None):
        raise PomonaError(f"{path}: found suffix {path.suffix!r} and --to {to}, expected the same or one of them")
    told = to or named
    if told is None:
        raise PomonaError(f"{path}: found suffix {path.suffix!r}, expected {', '.join(SUFFIXES)}, or --to FORMAT")
    return told
