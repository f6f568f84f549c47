"""`pomona export`: fruits for other programs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from pomona.cli.match_options import Unit
from pomona.cli.terminal import say
from pomona.cli.verbs import Writes
from pomona.likes import EXPORTS


class Format(StrEnum):
    """What to write."""

    csv = "csv"
    ply = "ply"
    geojson = "geojson"


def export(
    source: Path = typer.Argument(
        metavar="SESSION_OR_MAP", help="A session or a map (.gpkg), or a cloud (.csv, .ply)."
    ),
    to: Format = typer.Option(..., help="Format of the file to write."),
    output: Annotated[Path, Writes(lambda given: EXPORTS[given["to"]])] = typer.Option(
        ..., "-o", "--output", help="The file to write; - is the standard output."
    ),
    unit: Unit = typer.Option(Unit.m, help="Unit of the coordinates of a .csv or .ply."),
) -> None:
    """Write fruits with their ids, in metres: a session's in its own frame, a map's in the map's, where last seen."""
    from pomona.cloud import FruitCloud
    from pomona.export import export_cloud

    cloud = FruitCloud.read(source, unit=unit.value)
    export_cloud(cloud, output, to.value)
    say(f"{output}: {len(cloud)} fruits")
