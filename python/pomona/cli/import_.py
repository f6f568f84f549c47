"""`pomona import ...`: published data sets become recording folders."""

from __future__ import annotations

from pathlib import Path

import typer

from pomona.amounts import amount
from pomona.cli.terminal import say
from pomona.cli.verbs import Verbs

app = Verbs(help="Make recording folders out of published data sets.", no_args_is_help=True)


@app.callback()
def _import() -> None:
    """Make recording folders out of published data sets."""


@app.command("kinect-apples")
def import_kinect_apples(
    source: Path = typer.Argument(metavar="DIR", help="Folder with HHMMSS_depth.png, HHMMSS_boxes.csv ..."),
    output: Path = typer.Argument(metavar="OUT", help="Folder for the recordings, one subfolder a capture."),
    date: str | None = typer.Option(None, metavar="DAY", help="Day of the captures; else 2021-09-27, as published."),
) -> None:
    """Import the captures of one Fuji scene by an Azure Kinect (GRAP-UdL-AT/ak_sw_benchmarker).

    The intrinsics are nominal: f = 913 px, so diameters carry its error.
    """
    from pomona.recording.formats.kinect_apples import DATE, import_captures

    for capture in import_captures(source, output, date or DATE):
        colour = "depth and colour" if capture.has_colour else "depth only, no colour picture in the data set"
        say(f"{capture.folder}: {amount(capture.boxes, 'box')}, {colour}")
