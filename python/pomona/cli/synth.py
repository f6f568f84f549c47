"""`pomona synth ...`: seeded orchards with truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.cli.synth_video import synth_video
from pomona.cli.verbs import Verbs, Writes
from pomona.likes import VISITS

if TYPE_CHECKING:
    from pomona.synth.clouds import ScenePair

app = Verbs(help="Draw seeded orchards with known truth.", no_args_is_help=True)


@app.callback()
def _synth() -> None:
    """Draw seeded orchards with known truth."""


@app.command("clouds")
def synth_clouds(
    cell: str = typer.Argument(help="Test cell, for example base, part45, noov; an unknown name lists them all."),
    output: Annotated[Path, Writes(VISITS)] = typer.Option(
        ..., "-o", "--output", help="Folder to write to; made where it does not exist."
    ),
    seed: int = typer.Option(0, help="Which pair of visits to draw."),
    seeds: str = typer.Option("", help="FIRST:END instead draws many pairs; END is not drawn.", metavar="FIRST:END"),
) -> None:
    """Write two visits to a row as query.csv and map.csv, and their truth as truth.json.

    Equal ids are the same fruit. With --seeds the names carry the seed: query_7.csv, map_7.csv, truth_7.json.
    """
    from rich.console import Console
    from rich.progress import track

    from pomona.synth.clouds import scene_pair

    wanted = _seed_range(seeds) if seeds else range(seed, seed + 1)
    first = scene_pair(cell, wanted.start)
    output.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=True)
    for number in track(wanted, "drawing", console=console, disable=not (seeds and console.is_terminal)):
        pair = first if number == wanted.start else scene_pair(cell, number)
        _write(pair, output, f"_{number}" if seeds else "")


app.command("video")(synth_video)


def _seed_range(text: str) -> range:
    from pomona.errors import PomonaError

    first, colon, end = text.partition(":")
    if not (colon and first.isdecimal() and end.isdecimal() and int(first) < int(end)):
        raise PomonaError(f"--seeds: found {text!r}, expected FIRST:END with FIRST below END, for example 0:100")
    return range(int(first), int(end))


def _write(pair: ScenePair, folder: Path, suffix: str) -> None:
    import json

    from pomona.atomic import whole_file

    pair.query.write(folder / f"query{suffix}.csv")
    pair.map.write(folder / f"map{suffix}.csv")
    truth = {
        "cell": pair.cell.name,
        "seed": pair.seed,
        "right_answers": pair.cell.right_answers,
        "map_from_query": pair.map_from_query.tolist(),
        "scale": pair.scale,
        "noise_m": pair.noise_m,
        "up": None if pair.up is None else pair.up.tolist(),
    }
    with whole_file(folder / f"truth{suffix}.json") as partial:
        partial.write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
