"""`pomona triangulate MODEL -o session.gpkg`: posed pictures of one camera become the fruits of one session."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pomona.cli.match_options import config_option, threads_option
from pomona.cli.posed_options import (
    detections_option,
    min_score_option,
    model_argument,
    model_option,
    pictures_option,
)
from pomona.cli.terminal import say, say_json
from pomona.cli.verbs import Writes
from pomona.likes import SCANNED


def triangulate(
    reconstruction: Path = model_argument,
    output: Annotated[Path, Writes(SCANNED)] = typer.Option(..., "-o", "--output", help="Session to write, .gpkg."),
    orchard: Path | None = typer.Option(
        None, "--map", metavar="ORCHARD", help="Take the scale, and the frame, of this map; else there are no metres."
    ),
    detections: Path | None = detections_option,
    model: Path | None = model_option,
    pictures: Path | None = pictures_option,
    min_score: float | None = min_score_option,
    config: Path | None = config_option,
    threads: int | None = threads_option,
    name: str | None = typer.Option(None, help="Name of the session; else the folder's."),
    date: str | None = typer.Option(
        None, metavar="ISO-DATE", help="Day of the visit, 2024-08-09 or 2024-08-09T14:30:00."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Find every fruit that the posed pictures of MODEL show once, in 3D, and write the session.

    Without --map the session has no scale: it can be matched with --scale free, and no map takes it. Exit code 0:
    written. 1: not found in the map, a result too, and nothing is written. 2: wrong input.
    """
    from pomona.cli import metric_output
    from pomona.errors import PomonaError
    from pomona.free_scale import metric
    from pomona.free_scale.triangulate import triangulate as written
    from pomona.outputs import refuse_inputs
    from pomona.reconstruction import open_reconstruction
    from pomona.settings import Settings
    from pomona.store.values import iso_date
    from pomona.triangulation.model_recording import ModelRecording
    from pomona.triangulation.seen_fruits import open_boxes

    if output.suffix.lower() != ".gpkg":
        raise PomonaError(f"{output}: found suffix {output.suffix!r}, expected .gpkg")
    day = None if date is None else iso_date(date, "--date")
    overrides = Settings.load(config, {}).overrides
    recording = ModelRecording.open(open_reconstruction(reconstruction), pictures)
    boxes = open_boxes(recording, detections, model, min_score=min_score)
    refuse_inputs([output], [*recording.inputs(), *boxes.inputs])
    seen = metric_output.looked_at(recording, boxes)
    upgrade = None if orchard is None else metric(seen.cloud, orchard, config=overrides, threads=threads)
    is_lost = upgrade is not None and not upgrade
    if not is_lost:
        written(output, seen.cloud, recording, boxes, upgrade=upgrade, name=name, date=day)
    found = {"n_fruits": len(seen.cloud)} if upgrade is None else upgrade.numbers
    if json:
        say_json({"output": None if is_lost else str(output), **found})
    else:
        say(*metric_output.of_session(output, seen, upgrade))
    if is_lost:
        raise typer.Exit(1)
