"""`pomona match QUERY MAP`: which fruit of one visit is which fruit of another."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pomona.errors import PomonaError

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud
    from pomona.matching import Match


class Method(StrEnum):
    """Which method decides."""

    paper = "paper"
    verified = "verified"


class Scale(StrEnum):
    """What is known of the two clouds' scales."""

    metric = "metric"
    free = "free"


class Unit(StrEnum):
    """Unit of the coordinates in the files."""

    m = "m"
    cm = "cm"
    mm = "mm"
    free = "free"


method_option = typer.Option(None, help="The paper's votes, or constellations verified by log-odds (the default).")
scale_option = typer.Option(None, help="metric: both clouds are in metres (the default); free: their ratio is unknown.")
noise_option = typer.Option(
    None, "--noise", min=0.0, help="Relative noise of the visits per axis, metres; estimated where not given."
)
up_option = typer.Option(
    None,
    "--up",
    metavar="X,Y,Z",
    help="The vertical, as a direction. Once: the same in both clouds; twice: in the query, then in the map.",
)
config_option = typer.Option(None, help="Settings as TOML; `pomona config` prints them all.")
per_frame_option = typer.Option(
    None, "--per-frame/--whole", help="One transform for each frame of the query, pairs merged; or one for the cloud."
)
threads_option = typer.Option(None, min=1, help="How many threads to use; the answer is the same for any number.")


def match(
    query: Path = typer.Argument(metavar="QUERY", help="Fruits to find again: .csv, .ply or a session .gpkg."),
    map: Path = typer.Argument(
        metavar="MAP", help="Fruits to find them among: .csv, .ply, a session or an orchard map .gpkg."
    ),
    method: Method | None = method_option,
    scale: Scale | None = scale_option,
    noise_m: float | None = noise_option,
    up: list[str] | None = up_option,
    config: Path | None = config_option,
    per_frame: bool | None = per_frame_option,
    threads: int | None = threads_option,
    unit: Unit | None = typer.Option(None, help="Unit of the coordinates in the files; m, or free with --scale free."),
    output: Path | None = typer.Option(None, "-o", "--output", help="Write the pairs here as CSV."),
    plot: Path | None = typer.Option(None, help="Draw the match here: .png, .svg or .pdf."),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
    explain: bool = typer.Option(False, "--explain", help="Print what happened, stage by stage, with counts."),
) -> None:
    """Find the fruits of QUERY again in MAP.

    Exit code 0: found. 1: no match, a result too: TooFew, Ambiguous or NoMatch. 2: wrong input.
    """
    from pomona.cli.progress import working
    from pomona.cloud import FruitCloud
    from pomona.pairs import write_pairs
    from pomona.settings import Settings

    settings = Settings.load(config, call_flags(method, scale, noise_m, up, per_frame, threads))
    if plot is not None:
        from pomona.plot import require_picture_name

        require_picture_name(plot)
    read_unit = unit or (Unit.free if settings.call["scale"] == Scale.free else Unit.m)
    in_query = FruitCloud.read(query, unit=read_unit.value)
    in_map = FruitCloud.read(map, unit=read_unit.value)
    with working(f"matching {len(in_query)} fruits with {len(in_map)}"):
        answer = settings.match(in_query, in_map)
    if output is not None:
        write_pairs(output, answer, in_query, in_map)
    if plot is not None:
        _draw(plot, in_query, in_map, answer, settings.call["up"])
    _print(answer, in_query, in_map, json=json, explain=explain)
    if answer.status != "Found":
        raise typer.Exit(1)


def call_flags(
    method: Method | None,
    scale: Scale | None,
    noise_m: float | None,
    up: list[str] | None,
    per_frame: bool | None,
    threads: int | None,
) -> dict[str, object]:
    """Return the flags under the names of `pomona.match`'s arguments; None where a flag was not given."""
    return {
        "method": method and method.value,
        "scale": scale and scale.value,
        "noise_m": noise_m,
        "up": _parse_up(up) if up else None,
        "per_frame": per_frame,
        "threads": threads,
    }


def _parse_up(texts: list[str]) -> list[list[float]]:
    if len(texts) > 2:
        raise PomonaError(f"--up: found {len(texts)} directions, expected one for both clouds or query then map")
    directions = []
    for text in texts:
        try:
            x, y, z = (float(number) for number in text.split(","))
        except ValueError:
            raise PomonaError(f"--up: found {text!r}, expected three numbers X,Y,Z") from None
        directions.append([x, y, z])
    return directions if len(directions) == 2 else directions * 2


def _draw(path: Path, query: FruitCloud, map: FruitCloud, answer: Match, up: list[list[float]] | None) -> None:
    from pomona.plot import draw_match, save_picture

    save_picture(draw_match(query, map, answer, up_in_map=up[1] if up else None), path)


def _print(answer: Match, query: FruitCloud, map: FruitCloud, *, json: bool, explain: bool) -> None:
    from pomona.cli.match_output import as_json, as_stages, as_text

    if json:
        import json as json_format

        typer.echo(json_format.dumps(as_json(answer, query, map)))
    else:
        typer.echo(as_text(answer))
    if explain:
        # With --json the standard output belongs to the program that reads it.
        typer.echo(as_stages(answer), err=json)
