"""`pomona match QUERY MAP`: which fruit of one visit is which fruit of another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.amounts import amount
from pomona.cli.match_options import (
    Method,
    PlotView,
    Scale,
    Unit,
    call_flags,
    config_option,
    method_option,
    noise_option,
    per_frame_option,
    scale_option,
    threads_option,
    up_option,
)
from pomona.cli.terminal import say, say_json, tell
from pomona.cli.verbs import Writes
from pomona.likes import PAIRS, PICTURE

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud
    from pomona.matching import Match
    from pomona.settings import Settings


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
    query_unit: Unit | None = typer.Option(None, help="Unit of the coordinates of QUERY, where it is another."),
    output: Annotated[Path | None, Writes(PAIRS)] = typer.Option(
        None, "-o", "--output", help="Write the pairs here, .csv; - is the standard output."
    ),
    plot: Annotated[Path | None, Writes(PICTURE)] = typer.Option(None, help="Draw the match here: .png, .svg or .pdf."),
    plot_view: PlotView = typer.Option(
        PlotView.row, help="row: both visits in one frame, found, new and missed; lines: aside, a line for every pair."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
    explain: bool = typer.Option(False, "--explain", help="Print what happened, stage by stage, with counts."),
) -> None:
    """Find the fruits of QUERY again in MAP.

    Exit code 0: found. 1: no match, a result too: TooFew, Ambiguous or NoMatch. 2: wrong input.
    """
    from pomona.cli.progress import working
    from pomona.cloud import FruitCloud
    from pomona.file_names import require_suffix
    from pomona.pairs import write_pairs
    from pomona.settings import Settings

    if output is not None:
        require_suffix(output, (".csv",))
    settings = Settings.load(config, call_flags(method, scale, noise_m, up, per_frame, threads))
    if plot is not None:
        from pomona.plot import require_picture_name

        require_picture_name(plot)
    read_unit = unit or (Unit.free if settings.call["scale"] == Scale.free else Unit.m)
    in_query = FruitCloud.read(query, unit=(query_unit or read_unit).value)
    in_map = FruitCloud.read(map, unit=read_unit.value)
    with working(f"matching {amount(len(in_query), 'fruit')} with {len(in_map)}"):
        answer = settings.match(in_query, in_map)
    if output is not None:
        write_pairs(output, answer, in_query, in_map)
    if plot is not None:
        _draw(plot, in_query, in_map, answer, settings.call["up"], plot_view)
    _print(answer, in_query, in_map, json=json, explain=explain)
    if answer.status == "NoMatch" and settings.call["up"] is not None:
        tell("pomona: only poses that stand upright by --up were taken; given once, it holds for both clouds")
    _doubt_hands(in_query, in_map, answer, settings)
    if answer.status != "Found":
        raise typer.Exit(1)


def _doubt_hands(query: FruitCloud, map: FruitCloud, answer: Match, settings: Settings) -> None:
    from pomona.cli.progress import working
    from pomona.mirrored import pairs_of_mirror_image

    with working("looking at the mirror image of QUERY"):
        pairs = pairs_of_mirror_image(query, map, answer, settings)
    if pairs:
        left_handed = "the axes of one of them are left-handed, and the sign of one axis has to be changed"
        tell(f"pomona: the mirror image of QUERY fits MAP, with {amount(pairs, 'pair')}: {left_handed}")


def _draw(
    path: Path, query: FruitCloud, map: FruitCloud, answer: Match, up: list[list[float]] | None, view: PlotView
) -> None:
    from pomona.plot import draw_match, save_picture

    save_picture(draw_match(query, map, answer, up_in_map=up[1] if up else None, view=view.value), path)


def _print(answer: Match, query: FruitCloud, map: FruitCloud, *, json: bool, explain: bool) -> None:
    from pomona.cli.match_output import as_json, as_lines, as_stages

    if json:
        say_json(as_json(answer, query, map))
    else:
        say(*as_lines(answer))
    if explain:
        # With --json the standard output belongs to the program that reads it.
        (tell if json else say)(*as_stages(answer))
