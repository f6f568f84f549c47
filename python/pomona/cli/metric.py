"""`pomona metric MODEL ORCHARD -o MODEL2`: a reconstruction without a scale, in the metres of a map."""

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
from pomona.likes import METRIC_MODEL


def metric(
    reconstruction: Path = model_argument,
    orchard: Path = typer.Argument(
        metavar="ORCHARD", help="Fruits of the map, metres: an orchard map, a session, or a cloud."
    ),
    output: Annotated[Path, Writes(METRIC_MODEL)] = typer.Option(
        ..., "-o", "--output", metavar="MODEL2", help="Folder to write the model to, in the frame of the map."
    ),
    detections: Path | None = detections_option,
    model: Path | None = model_option,
    pictures: Path | None = pictures_option,
    min_score: float | None = min_score_option,
    config: Path | None = config_option,
    threads: int | None = threads_option,
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Bring the reconstruction MODEL into the frame and the metres of ORCHARD by the fruits that both show.

    Exit code 0: found and written. 1: not found, a result too, and nothing is written. 2: wrong input.
    """
    from pomona.cli import metric_output
    from pomona.free_scale import metric as made_metric
    from pomona.free_scale.metric import write_metric
    from pomona.outputs import refuse_inputs
    from pomona.reconstruction import open_reconstruction
    from pomona.settings import Settings
    from pomona.triangulation.model_recording import ModelRecording
    from pomona.triangulation.seen_fruits import open_boxes

    overrides = Settings.load(config, {}).overrides
    sparse = open_reconstruction(reconstruction)
    recording = ModelRecording.open(sparse, pictures)
    boxes = open_boxes(recording, detections, model, min_score=min_score)
    refuse_inputs([output], [*recording.inputs(), *boxes.inputs])
    seen = metric_output.looked_at(recording, boxes)
    upgrade = made_metric(seen.cloud, orchard, config=overrides, threads=threads)
    if upgrade:
        write_metric(output, sparse, upgrade, {"model": reconstruction.resolve().name, "map": orchard.name})
    if json:
        say_json({"output": str(output) if upgrade else None, **upgrade.numbers})
    else:
        say(*metric_output.as_lines(output, seen, upgrade))
    if not upgrade:
        raise typer.Exit(1)
