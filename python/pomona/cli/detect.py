"""`pomona detect`: fruits in pictures become a table of boxes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.amounts import amount
from pomona.cli.terminal import say, say_json
from pomona.cli.verbs import Writes
from pomona.likes import BOXES, DRAWN_BOXES

if TYPE_CHECKING:
    from pomona.detect import Detections


def detect(
    pictures: list[Path] = typer.Argument(metavar="PICTURE...", help="Pictures, or folders of them."),
    output: Annotated[Path, Writes(BOXES)] = typer.Option(
        ..., "-o", "--output", help="Table image,xmin,ymin,xmax,ymax,score; - is the standard output."
    ),
    model: Path = typer.Option(
        "shipped", metavar="ONNX", help="Detector: a file, or shipped, or shipped-fp32, slower and in 32 bits."
    ),
    min_score: float | None = typer.Option(None, min=0.0, max=1.0, help="Least score; else what the model asks for."),
    tiles: str = typer.Option("auto", metavar="auto|off|NxM", help="Tiles of a large picture."),
    augment: bool | None = typer.Option(
        None,
        "--augment/--no-augment",
        help="Look at each picture twice, once enlarged; else where the network sees them in their own size.",
    ),
    plot: Annotated[Path | None, Writes(DRAWN_BOXES)] = typer.Option(
        None, metavar="DIR", help="Draw the boxes into pictures here."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Find the fruits in PICTURE and write a box around each.

    A picture that cannot be read is skipped and told; nothing is written where none can be.
    """
    from pomona.atomic import whole_file
    from pomona.cli.progress import counting
    from pomona.detect.on_pictures import detect_in
    from pomona.detect.onnx import OnnxDetector
    from pomona.detect.picture_boxes import table_of
    from pomona.detect.picture_file import pictures_in
    from pomona.detect.shipped import is_shipped, model_named
    from pomona.file_names import require_suffix
    from pomona.outputs import refuse_inputs

    require_suffix(output, (".csv",))
    named = pictures_in(pictures)
    outputs = [output, *([plot] if plot else [])]
    refuse_inputs(outputs, [*named.values(), model_named(model)])
    detector = OnnxDetector.open(model_named(model), min_score=min_score, tiles=tiles, augment=augment)
    with counting("detecting", len(named)) as progress:
        found, skipped = detect_in(named, detector, plot, progress, is_inside=is_shipped(model))
    with whole_file(output) as partial:
        partial.write_text(table_of(found.items()), encoding="utf-8")
    if json:
        told = {"output": str(output), "model": str(detector.path), "n_boxes": _counts(found), "skipped": skipped}
        say_json(told)
    else:
        say(*(f"{name}: {amount(count, 'fruit')}" for name, count in _counts(found).items()))
        say(*(f"{name}: skipped" for name in skipped))


def _counts(found: dict[str, Detections]) -> dict[str, int]:
    return {name: len(detections) for name, detections in found.items()}
