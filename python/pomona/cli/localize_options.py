"""What the verbs that localise are told: flags with their help, shared by `localize` and `ros replay`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pomona.cli.match_options import Unit
from pomona.errors import PomonaError

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud

single_option = typer.Option(False, "--single", help="Find each frame from nothing, not from the one before.")
detections_option = typer.Option(
    None, metavar="FILE", help="Boxes, as for `pomona scan`; else detections.csv or ids/ there, else --model."
)
model_option = typer.Option(None, metavar="ONNX", help="Detector instead of boxes: a file, or shipped.")
min_score_option = typer.Option(None, min=0.0, max=1.0, help="Least confidence of the model's boxes.")
depth_option = typer.Option(
    "auto", metavar="auto|stereo|dense|ONNX", help="Depth pictures, else stereo at the fruits; or stereo all over."
)
index_option = typer.Option(
    None, "--index", metavar="FILE", help="Index of a large ORCHARD, which opens at once; made where there is none."
)
odometry_option = typer.Option(False, "--odometry", help="Motion from the pictures, even where poses were recorded.")
unit_option = typer.Option(None, "--unit", metavar="m|cm|mm", help="Unit of ORCHARD, where it is a .csv or .ply.")


def fruits_of_map(orchard: Path, unit: Unit | None) -> Path | FruitCloud:
    """Read a cloud in its unit; whatever else holds a map stays a file.

    Raises
    ------
    PomonaError
        The file has metres of its own, a frame shows none, or the cloud cannot be read.
    """
    from pomona.cloud import FruitCloud

    if unit is None:
        return orchard
    if unit.value == "free":
        raise PomonaError("--unit: found free, expected m, cm or mm: a frame is in metres")
    if orchard.suffix.lower() == ".gpkg":
        raise PomonaError(f"--unit: found it with {orchard}, expected it with a .csv or .ply alone")
    return FruitCloud.read(orchard, unit=unit.value)
