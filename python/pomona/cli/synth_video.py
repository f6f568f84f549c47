"""`pomona synth video`: a seeded row as a stereo recording with truth."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Annotated

import typer

from pomona.amounts import amount
from pomona.cli.flags import told_by_flags
from pomona.cli.terminal import say
from pomona.cli.verbs import Writes
from pomona.likes import RENDERED

FLAGS = {"n_trees": "--trees", "system": "--system", "cultivar": "--cultivar"}
"""What the flags change in the design of the row."""


def synth_video(
    output: Annotated[Path, Writes(RENDERED)] = typer.Option(
        ..., "-o", "--output", help="Folder of the recording; an interrupted one is gone on with."
    ),
    trees: int = typer.Option(5, help="Trees in the row."),
    system: str = typer.Option("spindle", help="How the trees are trained."),
    cultivar: str = typer.Option("gala", help="What grows on them."),
    date: datetime.datetime = typer.Option("2024-08-09", formats=["%Y-%m-%d"], help="Day of the visit."),
    seed: int = typer.Option(0, min=0, help="Which row; each day has a weather, a shake and a noise of its own."),
    path: str = typer.Option("tractor", help="Way of the camera: tractor, tractor-back, fast, hand-held, far, ..."),
    weather: str = typer.Option("sun", help="sun, hazy, overcast or dusk."),
    pairs: int = typer.Option(0, min=0, help="Pairs; 0 for as many as the path takes at 10 a second."),
    width: int = typer.Option(640, help="Columns of a picture."),
    height: int = typer.Option(360, help="Rows of a picture."),
    jitter: float = typer.Option(
        0.0, min=0.0, max=1.0, help="How far the path strays from its own distance, height and direction."
    ),
    right_gain: float = typer.Option(1.0, min=0.1, max=4.0, help="Exposure of the right eye against the left."),
    shutter_ms: float = typer.Option(2.0, min=0.0, max=50.0, help="How long a picture is exposed."),
    jpeg: int = typer.Option(0, min=0, max=100, help="Quality of JPEG pictures; 0 writes PNG."),
    renderer: str = typer.Option("raster", help="raster is fast, photo traces paths, photo-gpu on a graphics card."),
) -> None:
    """Render a drive along a seeded row as a stereo recording, with poses, depth, ids, boxes and fruits as truth."""
    from pomona.cli.progress import counting
    from pomona.render.filming import Filming, film
    from pomona.render.sensor import Sensor
    from pomona.synth.living import RowDesign

    with told_by_flags(FLAGS):
        design = RowDesign(system=system, cultivar=cultivar, n_trees=trees)
    filming = Filming(
        design=design,
        day=date.date(),
        seed=seed,
        path=path,
        weather=weather,
        pairs=pairs,
        size_px=(width, height),
        jitter=jitter,
        eyes=(Sensor(shutter_s=1e-3 * shutter_ms), Sensor(shutter_s=1e-3 * shutter_ms, gain=right_gain)),
        jpeg_quality=jpeg or None,
        renderer=renderer,
    )
    with counting("rendering") as tell:
        done = film(filming, output, tell=tell)
    say(f"{output}: {amount(done, 'pair')} of {width}x{height}")
