"""Fruits of a session or a map for other programs."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.cloud import FruitCloud, csv_file, ply_file
from pomona.cloud.columns import COVARIANCE, COVARIANCE_CELLS, POSITION, typed_columns
from pomona.errors import PomonaError
from pomona.geopackage import LOCAL_METRES
from pomona.geoparquet import write_geoparquet
from pomona.shapefile import WGS84_TEXT, write_shapefile
from pomona.streams import is_stream

if TYPE_CHECKING:
    from pomona.earth import Anchor

__all__ = ["SUFFIXES", "CloudFormat", "ExportFormat", "PoseFormat", "export_cloud", "export_trajectory", "format_of"]

CloudFormat = Literal["csv", "ply", "geojson", "shp", "parquet", "mcap"]
PoseFormat = Literal["tum", "kitti"]
ExportFormat = CloudFormat | PoseFormat

SUFFIXES: dict[str, ExportFormat] = {
    ".csv": "csv",
    ".ply": "ply",
    ".geojson": "geojson",
    ".json": "geojson",
    ".shp": "shp",
    ".parquet": "parquet",
    ".mcap": "mcap",
    ".tum": "tum",
    ".kitti": "kitti",
}
"""What the name of a file says of its format."""


def export_cloud(cloud: FruitCloud, path: str | Path, to: CloudFormat, anchor: Anchor | None = None) -> None:
    """Write fruits with their ids, in metres, in the frame they are in; the file appears whole or not at all.

    Parameters
    ----------
    cloud : FruitCloud
        The fruits, for example ``FruitCloud.read("orchard.gpkg")``.
    path : str or Path
        The file to write; its suffix is yours to choose.
    to : {"csv", "ply", "geojson", "shp", "parquet", "mcap"}
        Its format. Rows without ids get their row numbers in the last four. An MCAP is a scene for Foxglove.
    anchor : Anchor, optional
        Where on Earth the frame lies, for example ``OrchardMap("orchard.gpkg").anchor()``. GeoJSON, Shapefile and
        GeoParquet then have longitude, latitude (WGS 84) and height, a CSV has them as further columns, and an MCAP has
        metres east, north and up.
    """
    path = Path(path)
    if anchor is not None and to in ("geojson", "shp", "parquet"):
        _write_on_earth(path, cloud, anchor.geodetic(cloud.positions), to)
    elif to == "csv":
        csv_file.write(path, cloud if anchor is None else _with_earth(cloud, anchor))
    elif to == "ply":
        ply_file.write(path, cloud)
    elif to == "geojson":
        _write_geojson(path, cloud)
    elif to == "shp":
        write_shapefile(path, cloud.positions, _plain_columns(cloud))
    elif to == "parquet":
        write_geoparquet(path, cloud.positions, _plain_columns(cloud))
    elif to == "mcap":
        _write_scene(path, cloud if anchor is None else cloud.transformed(anchor.enu_from_map))
    else:
        raise PomonaError(f"--to: found {to!r}, expected one of {', '.join(get_args(CloudFormat))}")


def export_trajectory(session: str | Path, path: str | Path, to: PoseFormat) -> int:
    """Write where the camera of a session was, in the session's frame; return for how many frames.

    Parameters
    ----------
    session : str or Path
        A session (.gpkg).
    path : str or Path
        The file to write.
    to : {"tum", "kitti"}
        TUM text has times, KITTI's has not: its lines are the session's frames, one after the other.

    Raises
    ------
    PomonaError
        The file is no session, or one without poses.
    """
    from pomona.orchard import read_session
    from pomona.recording.poses import write_kitti, write_tum

    trajectory = read_session(session).trajectory
    if trajectory is None:
        raise PomonaError(f"{session}: found a session without poses, expected a trajectory")
    with whole_file(Path(path)) as partial:
        (write_tum if to == "tum" else write_kitti)(partial, trajectory)
    return len(trajectory)


def _write_on_earth(path: Path, cloud: FruitCloud, geodetic: NDArray[np.float64], to: ExportFormat) -> None:
    if to == "geojson":
        # RFC 7946: longitude, latitude, height, and no member crs.
        _write_features(path, cloud, geodetic, {"comment": "fruits by pomona"})
    elif to == "shp":
        write_shapefile(path, geodetic, _plain_columns(cloud), WGS84_TEXT)
    else:
        write_geoparquet(path, geodetic, _plain_columns(cloud), on_earth=True)


def _write_scene(path: Path, cloud: FruitCloud) -> None:
    from pomona.ros.scene_file import write_scene

    write_scene(path, cloud)


def _with_earth(cloud: FruitCloud, anchor: Anchor) -> FruitCloud:
    names = ("longitude_deg", "latitude_deg", "height_m")
    texts = (
        tuple(f"{number:.{digits}f}" for number in column)
        for column, digits in zip(anchor.geodetic(cloud.positions).T.tolist(), (10, 10, 4), strict=True)
    )
    return replace(cloud, extras={**cloud.extras, **dict(zip(names, texts, strict=True))})


def _write_geojson(path: Path, cloud: FruitCloud) -> None:
    """Write GeoJSON whose coordinates are local metres.

    RFC 7946 knows longitude and latitude only. The specification of 2008, which QGIS and GDAL read, names a coordinate
    system: with ours, programs that know it do not take the metres for degrees, and the others skip the name.
    """
    _write_features(path, cloud, cloud.positions, {"crs": {"type": "name", "properties": {"name": LOCAL_METRES}}})


def _write_features(path: Path, cloud: FruitCloud, places: NDArray[np.float64], about: dict[str, Any]) -> None:
    head = {"type": "FeatureCollection", "name": path.stem, **about}
    columns = _properties(cloud)
    with whole_file(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(json.dumps(head)[:-1] + ', "features": [')
        for row, position in enumerate(places.tolist()):
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
        When neither tells, or they contradict each other. A stream without a suffix gets CSV.
    """
    named = SUFFIXES.get(path.suffix.lower())
    if to is not None and named not in (to, None):
        raise PomonaError(f"{path}: found suffix {path.suffix!r} and --to {to}, expected the same or one of them")
    told = to or named or ("csv" if not path.suffix and is_stream(path) else None)
    if told is None:
        found = f"suffix {path.suffix!r}" if path.suffix else "no suffix"
        raise PomonaError(f"{path}: found {found}, expected --to FORMAT, or one of {', '.join(SUFFIXES)}")
    return told
