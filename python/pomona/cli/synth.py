"""`pomona synth ...`: seeded orchards with truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pomona.amounts import amount
from pomona.cli.flags import told_by_flags
from pomona.cli.synth_video import synth_video
from pomona.cli.terminal import say
from pomona.cli.verbs import Verbs, Writes
from pomona.likes import VISITS, Like, drawn_season

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pomona.synth.clouds import ScenePair
    from pomona.synth.seasons import SeasonPlan

FLAGS = {
    "n_trees": "--trees",
    "visits": "--visits",
    "fruits_per_tree": "--fruits",
    "system": "--system",
    "cultivar": "--cultivar",
    "hidden_share": "--hidden",
    "false_rate": "--false",
}
"""What the flags of a season change in its plan."""

MOST_NOISE_MM = 1000.0

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
    seed: int | None = typer.Option(None, help="Which pair of visits to draw; else 0."),
    seeds: str = typer.Option("", help="FIRST:END instead draws many pairs; END is not drawn.", metavar="FIRST:END"),
) -> None:
    """Write two visits to a row as query.csv and map.csv, and their truth as truth.json.

    Equal ids are the same fruit. With --seeds the names carry the seed: query_7.csv, map_7.csv, truth_7.json.
    """
    from rich.console import Console
    from rich.progress import track

    from pomona.errors import PomonaError
    from pomona.synth.clouds import scene_pair

    if seeds and seed is not None:
        raise PomonaError(f"found --seed {seed} and --seeds {seeds}, expected one of them")
    wanted = _seed_range(seeds) if seeds else range(seed or 0, (seed or 0) + 1)
    first = scene_pair(cell, wanted.start)
    output.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=True)
    for number in track(wanted, "drawing", console=console, disable=not (seeds and console.is_terminal)):
        pair = first if number == wanted.start else scene_pair(cell, number)
        _write(pair, output, f"_{number}" if seeds else "")


app.command("video")(synth_video)


def _of_season(given: Mapping[str, Any]) -> Like:
    return drawn_season(given["season"], given["seed"])


@app.command("season")
def synth_season(
    season: str = typer.Argument("easy", help="Named season, easy or hard; the options change it."),
    output: Annotated[Path, Writes(_of_season)] = typer.Option(
        ..., "-o", "--output", help="Folder to write to; made where it does not exist."
    ),
    seed: int = typer.Option(0, help="Which row and which visits to draw."),
    visits: int | None = typer.Option(None, help="Number of visits, evenly over the season."),
    trees: int | None = typer.Option(None, help="Number of trees."),
    fruits: str = typer.Option("", help="Fewest and most fruits that set on a tree, as 60:100.", metavar="LEAST:MOST"),
    system: str = typer.Option("", help="Training system: spindle, cordon, wall."),
    cultivar: str = typer.Option("", help="Cultivar: gala, fuji, jonagold, granny-smith, golden."),
    hidden: float | None = typer.Option(None, help="Share of the fruits in view that a visit misses."),
    noise_mm: float | None = typer.Option(None, help="Standard deviation of a place, mm, per axis."),
    false_rate: float | None = typer.Option(None, "--false", help="False points as a fraction of the fruits seen."),
    same_frame: bool = typer.Option(False, help="Leave all sessions in the frame of the row."),
) -> None:
    """Write what several visits to a living row would see, as YYYY-MM-DD.csv, and the truth as truth.json.

    Fruits grow, sink with their branches, drop and are thinned; a visit misses, as many as asked, those of which
    leaves, wood and other fruits leave least to see from its side.
    """
    from dataclasses import replace

    from pomona.cli.progress import counting
    from pomona.synth.seasons import draw_season
    from pomona.synth.seasons.season_files import write_season

    plan = _named_season(season)
    design: dict[str, Any] = {"n_trees": trees, "system": system or None, "cultivar": cultivar or None}
    design["fruits_per_tree"] = _least_and_most(fruits) if fruits else None
    changes: dict[str, Any] = {"n_visits": visits, "hidden_share": hidden, "false_rate": false_rate}
    changes |= {"noise_m": None if noise_mm is None else _metres(noise_mm), "own_frames": not same_frame}
    with told_by_flags(FLAGS), counting("drawing", plan.n_visits) as progress:
        plan = replace(plan, design=replace(plan.design, **_given(design)), **_given(changes))
        drawn = draw_season(plan, seed, tell=progress)
    write_season(drawn, output)
    for visit in drawn.visits:
        say(f"{visit.day}  {amount(len(visit.cloud), 'fruit')}, {visit.drive.side} side")


def _metres(noise_mm: float) -> float:
    from pomona.errors import PomonaError

    if not 0.0 <= noise_mm <= MOST_NOISE_MM:  # NaN is in no range
        raise PomonaError(f"--noise-mm: found {noise_mm:g}, expected 0 to {MOST_NOISE_MM:g}")
    return noise_mm / 1000.0


def _given(options: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}


def _named_season(name: str) -> SeasonPlan:
    from pomona.errors import PomonaError
    from pomona.synth.seasons import SEASONS

    if name not in SEASONS:
        raise PomonaError(f"no season is called {name!r}; expected one of {', '.join(SEASONS)}")
    return SEASONS[name]


def _least_and_most(text: str) -> tuple[int, int]:
    from pomona.errors import PomonaError

    least, colon, most = text.partition(":")
    if not (colon and least.isdecimal() and most.isdecimal()):
        raise PomonaError(f"--fruits: found {text!r}, expected LEAST:MOST, for example 60:100")
    return int(least), int(most)


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
