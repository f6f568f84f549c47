"""`pomona train`: the detector learns a user's own fruit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pomona.amounts import amount
from pomona.cli.terminal import say, say_json, tell
from pomona.cli.verbs import Writes
from pomona.errors import PomonaError
from pomona.likes import MODEL


def train(
    pictures: list[Path] = typer.Argument(metavar="PICTURE...", help="Pictures, or folders of them."),
    boxes: Path = typer.Option(..., metavar="FILE", help="Table image,xmin,ymin,xmax,ymax: every fruit in them."),
    output: Annotated[Path, Writes(MODEL)] = typer.Option(..., "-o", "--output", help="Model to write, ONNX."),
    begin: Path = typer.Option(
        "shipped-fp32", metavar="ONNX", help="What to begin with: the shipped model, or one trained from it."
    ),
    batches: int = typer.Option(1200, min=1, help="Steps of 8 crops; half an hour on 2 cores."),
    seed: int = typer.Option(1, min=0, help="Of what is drawn."),
    work: Path | None = typer.Option(
        None, metavar="DIR", help="Where an interrupted training is kept; else beside the model."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Train the shipped detector on PICTURE with their boxes; the same call again goes on where it was interrupted.

    Ctrl-C keeps what was learnt, exit code 130.

    A picture without a box is one without fruits. A fifth of the pictures is kept apart: it calibrates the scores and
    says what the training was good for.
    """
    from pomona.cli.progress import counting, first_interrupt
    from pomona.detect.picture_file import pictures_in
    from pomona.detect.shipped import model_named
    from pomona.detect.training.extra import require_train
    from pomona.detect.training.labels import labelled_pictures
    from pomona.file_names import require_suffix
    from pomona.outputs import refuse_inputs
    from pomona.reading import require_file

    require_suffix(output, (".onnx",))
    require_file(model_named(begin), "a model")
    refuse_inputs([output], [*pictures_in(pictures).values(), boxes, model_named(begin)])
    labelled = labelled_pictures(pictures, boxes)
    _require_ours(model_named(begin))
    folder = work or output.parent / f"{output.name}.training"
    if folder.exists() and not folder.is_dir():
        raise PomonaError(f"{folder}: found a file, expected a folder for the state of the training")
    require_train()
    from pomona.detect.training.fine_tuning import fine_tune

    kept = 0

    def tell_done(done: int, _loss: float) -> None:
        nonlocal kept
        kept = done
        progress(done, batches)

    try:
        with counting("training", batches) as progress, first_interrupt() as stop:
            made = fine_tune(
                labelled,
                output,
                begin=model_named(begin),
                work=folder,
                batches=batches,
                seed=seed,
                progress=tell_done,
                stop=stop,
            )
    except KeyboardInterrupt:
        if kept:
            tell(f"pomona: {kept} of {batches} batches are kept in {folder}: the same call goes on from there")
        raise
    if json:
        counts = {"n_pictures": made.n_pictures, "n_fruits": made.n_fruits}
        ap50 = {"ap50_before": made.before, "ap50": made.after}
        say_json({"output": str(output), **counts, **ap50, "min_score": made.min_score})
        return
    say(
        f"{output}: trained on {amount(made.n_pictures, 'picture')} with {amount(made.n_fruits, 'fruit')}",
        f"  AP50 on the fifth kept apart: {made.before:.3f} before, {made.after:.3f} now",
        f"  counts are right from a score of {made.min_score:.2f} on, which it takes by itself",
    )


def _require_ours(model: Path) -> None:
    """Refuse a model of another family before anything else is asked for."""
    from pomona.detect.onnx import OnnxDetector

    family = OnnxDetector.open(model).signature.family
    if family != "pomona":
        raise PomonaError(f"{model}: found a model of {family}, expected the shipped one or one trained from it")
