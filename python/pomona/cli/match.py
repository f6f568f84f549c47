"""`pomona match QUERY MAP`: which fruit of one visit is which fruit of another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

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
    from numpy.typing import ArrayLike

    from pomona.cloud import FruitCloud
    from pomona.matching import Match
    from pomona.settings import Settings


class _ReadCloud(NamedTuple):
    """One of the two clouds: its file, and the unit that it was read in."""

    path: Path
    unit: Unit
    cloud: FruitCloud

    @property
    def is_doubted(self) -> bool:
        """Whether the file may be in another unit: a session is in metres, and free is any."""
        return self.path.suffix.lower() != ".gpkg" and self.unit is not Unit.free


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
    from pomona.cloud.files import read_cloud
    from pomona.file_names import require_suffix
    from pomona.pairs import write_pairs
    from pomona.row_length import length_in_map, length_told
    from pomona.settings import Settings

    if output is not None:
        require_suffix(output, (".csv",))
    settings = Settings.load(config, call_flags(method, scale, noise_m, up, per_frame, threads))
    if plot is not None:
        from pomona.plot import require_picture_name

        require_picture_name(plot)
    map_unit = unit or (Unit.free if settings.call["scale"] == Scale.free else Unit.m)
    sides = [
        _ReadCloud(path, one, read_cloud(path, one.value, FruitCloud, is_checked=False))
        for path, one in ((query, query_unit or map_unit), (map, map_unit))
    ]
    _doubt_units(*sides, is_query_told=query_unit is not None)
    in_query, in_map = (side.cloud for side in sides)
    with working(f"matching {amount(len(in_query), 'fruit')} with {len(in_map)}"):
        answer = settings.match(in_query, in_map)
    if output is not None:
        write_pairs(output, answer, in_query, in_map)
    if plot is not None:
        up_in_map = _vertical(map) if settings.call["up"] is None else settings.call["up"][1]
        _draw(plot, in_query, in_map, answer, up_in_map, plot_view)
    _print(answer, in_query, in_map, json=json, explain=explain)
    if answer.status == "NoMatch" and settings.call["up"] is not None:
        tell("pomona: only poses that stand upright by --up were taken; given once, it holds for both clouds")
    length = length_in_map(answer, in_query, in_map)
    if length is not None:
        tell(f"pomona: {length_told(length, 'QUERY', 'MAP')}")
    _doubt_hands(in_query, in_map, answer, settings)
    _doubt_metres(in_query, in_map, answer, settings)
    if answer.status != "Found":
        raise typer.Exit(1)


def _doubt_units(query: _ReadCloud, map: _ReadCloud, *, is_query_told: bool) -> None:
    """Warn of files whose places cannot be those of fruits, with the flags that mend those and no other."""
    from pomona.cloud.files import check_places

    of_query, of_map = _other_unit(query), _other_unit(map)
    both = of_query == of_map and not is_query_told
    keeps_query = "" if of_query or is_query_told else f" --query-unit {query.unit.value}"
    flags = (f"--unit {of_query}" if both else f"--query-unit {of_query}", f"--unit {of_map}{keeps_query}")
    for side, flag in zip((query, map), flags, strict=True):
        if side.is_doubted:
            check_places(side.path, side.cloud.positions, unit=side.unit.value, remedy=f"say so: {flag}")


def _other_unit(side: _ReadCloud) -> str | None:
    """Return the unit that a file is likelier in, None where its own is none to doubt."""
    from pomona.cloud.files import doubt_of_places, likely_unit

    doubt = doubt_of_places(side.cloud.positions) if side.is_doubted else None
    return likely_unit(side.cloud.positions, side.unit.value) if doubt is not None and doubt.is_of_unit else None


def _doubt_hands(query: FruitCloud, map: FruitCloud, answer: Match, settings: Settings) -> None:
    from pomona.cli.progress import working
    from pomona.mirrored import mirror_told, pairs_of_mirror_image

    with working("looking at the mirror image of QUERY"):
        pairs = pairs_of_mirror_image(query, map, answer, settings)
    if pairs:
        tell(f"pomona: {mirror_told(pairs, 'QUERY', 'MAP')}")


def _doubt_metres(query: FruitCloud, map: FruitCloud, answer: Match, settings: Settings) -> None:
    from pomona.cli.progress import working
    from pomona.other_metres import other_size, size_told

    with working("looking at other sizes of QUERY"):
        size = other_size(query, map, answer, settings)
    if size is not None:
        tell(f"pomona: {size_told(size, 'QUERY', 'MAP')} --scale free matches them so")


def _vertical(path: Path) -> ArrayLike | None:
    """Tell the vertical of a map or session, where it is known."""
    from pomona.viewer.row_frame import known_vertical

    return known_vertical(path) if path.suffix.lower() == ".gpkg" else None


def _draw(
    path: Path, query: FruitCloud, map: FruitCloud, answer: Match, up_in_map: ArrayLike | None, view: PlotView
) -> None:
    from pomona.plot import draw_match, save_picture

    save_picture(draw_match(query, map, answer, up_in_map=up_in_map, view=view.value), path)


def _print(answer: Match, query: FruitCloud, map: FruitCloud, *, json: bool, explain: bool) -> None:
    from pomona.cli.match_output import as_json, as_lines, as_stages

    if json:
        say_json(as_json(answer, query, map))
    else:
        say(*as_lines(answer))
    if explain:
        # With --json the standard output belongs to the program that reads it.
        (tell if json else say)(*as_stages(answer))
