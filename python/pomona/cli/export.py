"""`pomona export`: fruits for other programs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pomona.amounts import amount
from pomona.cli.match_options import Unit
from pomona.cli.terminal import say
from pomona.cli.verbs import Writes
from pomona.likes import BY_DATE, EXPORTS, Like

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud
    from pomona.export import ExportFormat, PoseFormat


class Format(StrEnum):
    """What to write."""

    csv = "csv"
    ply = "ply"
    geojson = "geojson"
    shp = "shp"
    parquet = "parquet"
    mcap = "mcap"
    tum = "tum"
    kitti = "kitti"
    parquet_by_date = "parquet-by-date"


_SINGLE: dict[Format, ExportFormat] = {
    Format.csv: "csv",
    Format.ply: "ply",
    Format.geojson: "geojson",
    Format.shp: "shp",
    Format.parquet: "parquet",
    Format.mcap: "mcap",
    Format.tum: "tum",
    Format.kitti: "kitti",
}
"""Formats of one file."""


def _like(given: Mapping[str, Any]) -> Like:
    from pomona.export import format_of

    if given["to"] is Format.parquet_by_date:
        return BY_DATE
    return EXPORTS[format_of(given["output"], given["to"])]


def _parts(output: Path) -> Iterable[Path]:
    """Give the other files of a Shapefile."""
    from pomona.shapefile import parts_of

    return (part for part in parts_of(output) if part != output) if output.suffix.lower() == ".shp" else ()


def export(
    source: Path = typer.Argument(
        metavar="SESSION_OR_MAP", help="A session or a map (.gpkg), or a cloud (.csv, .ply)."
    ),
    output: Annotated[Path, Writes(_like, also=_parts)] = typer.Option(
        ...,
        "-o",
        "--output",
        help="The file to write; - is the standard output, and gets CSV unless --to says otherwise.",
    ),
    to: Format | None = typer.Option(
        None,
        help="Format of the file to write, where its suffix does not say it; parquet-by-date is a folder with the "
        "observations of each row and date.",
    ),
    observations: bool = typer.Option(
        False, "--observations", help="Of a session or map: a row for each fruit and visit that saw it, with the date."
    ),
    growth: bool = typer.Option(
        False,
        "--growth",
        help="Of a map: with each fruit's tree, rate of growth, and forecast for --harvest.",
    ),
    harvest: str | None = typer.Option(None, metavar="DATE", help="With --growth: day to foretell, as 2024-09-10."),
    local: bool = typer.Option(False, "--local", help="Local metres, also where the map has a georeference."),
    unit: Unit = typer.Option(Unit.m, help="Unit of the coordinates of a .csv or .ply."),
) -> None:
    """Write fruits with their ids, in metres: a session's in its own frame, a map's in the map's, where last seen.

    A map with a georeference (`pomona map georeference`) gives longitude, latitude and height to GeoJSON, Shapefile,
    GeoParquet, and to CSV as further columns. An MCAP is a scene for Foxglove, fruits coloured by their state, or with
    --growth by their rate. Of a session, .tum and .kitti are where its camera was, in the session's frame.
    """
    from pomona.cloud import FruitCloud
    from pomona.export import export_cloud, format_of
    from pomona.orchard import OrchardMap

    if to is Format.parquet_by_date:
        _export_by_date(source, output, plain=not (growth or harvest))
        return
    told: ExportFormat | None = None if to is None else _SINGLE[to]
    wanted = format_of(output, told)
    match wanted:
        case "tum" | "kitti":
            _export_poses(source, output, wanted, plain=not (growth or harvest or observations))
            return
    if growth or harvest is not None:
        cloud = _grown(source, harvest, plain=not growth or observations)
    else:
        cloud = _observed(source) if observations else FruitCloud.read(source, unit=unit.value)
    anchor = None if local or source.suffix.lower() != ".gpkg" else OrchardMap(source).anchor()
    export_cloud(cloud, output, wanted, anchor)
    say(f"{output}: {amount(len(cloud), 'observation' if observations else 'fruit')}")


def _export_by_date(source: Path, output: Path, *, plain: bool) -> None:
    from pomona.errors import PomonaError
    from pomona.parquet_by_date import export_by_date

    if not plain:
        raise PomonaError("--to parquet-by-date: found it with --growth or --harvest, expected it alone")
    say(f"{output}: {export_by_date(source, output)} observations")


def _export_poses(source: Path, output: Path, to: PoseFormat, *, plain: bool) -> None:
    from pomona.errors import PomonaError
    from pomona.export import export_trajectory

    if not plain:
        raise PomonaError(f"--to {to}: found it with --growth, --harvest or --observations, expected it alone")
    say(f"{output}: {export_trajectory(source, output, to)} poses")


def _grown(source: Path, harvest: str | None, *, plain: bool) -> FruitCloud:
    from pomona.errors import PomonaError
    from pomona.growth.grown_cloud import grown_cloud
    from pomona.growth.harvest_day import harvest_day
    from pomona.growth.season_growth import grow_season

    if plain:
        raise PomonaError("--growth: found it with --observations, or --harvest without it, expected it alone or both")
    return grown_cloud(grow_season(source, harvest=harvest_day(harvest)))


def _observed(source: Path) -> FruitCloud:
    from pomona.errors import PomonaError
    from pomona.orchard import OrchardMap

    if source.suffix.lower() in (".csv", ".ply"):
        raise PomonaError(f"{source}: found a cloud, expected a session or a map (.gpkg) with --observations")
    return OrchardMap(source).observations().cloud()
