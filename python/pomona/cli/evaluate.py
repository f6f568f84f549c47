"""`pomona evaluate ...`: results against truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pomona.cli.evaluate_trajectory import evaluate_trajectory
from pomona.cli.terminal import say, say_json
from pomona.cli.verbs import Verbs

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud
    from pomona.evaluate import PairScore

app = Verbs(help="Compare results with the truth.", no_args_is_help=True)


@app.callback()
def _evaluate() -> None:
    """Compare results with the truth."""


app.command("trajectory")(evaluate_trajectory)


@app.command("match")
def evaluate_match(
    query: Path = typer.Argument(
        metavar="QUERY", help="The cloud that was matched (.csv, .ply, .gpkg), with true ids or with --truth."
    ),
    map: Path = typer.Argument(metavar="MAP", help="The cloud it was matched with."),
    pairs: Path = typer.Argument(
        metavar="PAIRS", help="What `pomona match` wrote with -o or --json; - reads the standard input."
    ),
    truth: list[Path] | None = typer.Option(
        None,
        metavar="FRUITS",
        help="True fruits: judge by place. Once: of both clouds; twice: the query's, then the map's, of common ids.",
    ),
    within_m: float | None = typer.Option(
        None, "--within", min=0.0, metavar="METRES", help="Radius around a true fruit, with --truth; else 0.03."
    ),
    align: bool = typer.Option(
        False, "--align", help="With --truth: the clouds have frames of their own, find them in the truth first."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON instead of a table."),
) -> None:
    """Precision and recall of a match: a pair is right where both fruits are the same true fruit.

    They are where they carry the same id, or with --truth where both lie nearest to it.
    """
    from pomona.cloud import FruitCloud
    from pomona.evaluate import score_pairs, score_placed_pairs
    from pomona.pairs import read_pairs

    in_query, in_map = FruitCloud.read(query, unit="free"), FruitCloud.read(map, unit="free")
    rows = read_pairs(pairs, in_query, in_map)
    if truth:
        placed = _placed((query, map), (in_query, in_map), truth, within_m, align)
        score = score_placed_pairs(rows, *placed)
    else:
        _require_truth(within_m, align)
        score = score_pairs(rows, *_common_ids((query, map), (in_query, in_map)))
    if json:
        say_json(_as_json(score))
    else:
        say(*_as_lines(score))


def _placed(
    paths: tuple[Path, Path],
    clouds: tuple[FruitCloud, FruitCloud],
    truth: list[Path],
    within_m: float | None,
    align: bool,
) -> list[tuple[str, ...]]:
    """Tell the true fruit of each row of both clouds by its place."""
    from pomona.cloud import FruitCloud
    from pomona.errors import PomonaError
    from pomona.truth import WITHIN_M, aligned, true_fruits

    if len(truth) > 2:
        raise PomonaError(
            f"--truth: found {len(truth)} files, expected one for both clouds or the query's and the map's"
        )
    true = [FruitCloud.read(path) for path in truth]
    if len(truth) == 2:
        _true_ids(truth[0], true[0])
        _true_ids(truth[1], true[1])
    placed = []
    for path, cloud, of_truth in zip(paths, clouds, true * (3 - len(true)), strict=True):
        try:
            cloud = aligned(cloud, of_truth) if align else cloud
            placed.append(true_fruits(cloud, of_truth, within_m=WITHIN_M if within_m is None else within_m))
        except PomonaError as error:
            raise PomonaError(f"{path}: {error}") from None
    return placed


def _require_truth(within_m: float | None, align: bool) -> None:
    from pomona.errors import PomonaError

    if align or within_m is not None:
        raise PomonaError(f"{'--align' if align else '--within'}: found without --truth FRUITS, expected it too")


def _common_ids(
    paths: tuple[Path, Path], clouds: tuple[FruitCloud, FruitCloud]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Give the ids of both clouds, unless they are those of two scans and say nothing about each other."""
    from pomona.errors import PomonaError

    in_query, in_map = (_true_ids(path, cloud) for path, cloud in zip(paths, clouds, strict=True))
    for path in paths:
        _refuse_numbers_of_a_tracker(path)
    if in_query and in_map and not set(in_query) & set(in_map):
        both = f"{paths[0]} and {paths[1]}"
        raise PomonaError(f"{both}: found no id in common, expected true ids; --truth FRUITS judges by place")
    return in_query, in_map


def _refuse_numbers_of_a_tracker(path: Path) -> None:
    from pomona.errors import PomonaError
    from pomona.orchard import OrchardMap, read_session

    if path.suffix.lower() != ".gpkg" or OrchardMap(path).kind != "session":
        return
    scan = read_session(path).configuration.get("scan")
    if isinstance(scan, dict) and scan.get("named") is False:
        found = "found ids that its tracker gave"
        raise PomonaError(f"{path}: {found}, expected true ids; --truth FRUITS judges by place")


def _true_ids(path: Path, cloud: FruitCloud) -> tuple[str, ...]:
    from pomona.errors import PomonaError

    if cloud.ids is None:
        raise PomonaError(f"{path}: found no column id, expected the true id of every fruit")
    return cloud.ids


def _as_json(score: PairScore) -> dict[str, float | None]:
    return {
        "precision": score.precision,
        "recall": score.recall,
        "true": score.true,
        "false": score.false,
        "missed": score.missed,
        "common": score.common,
        "unjudged": score.unjudged,
    }


def _as_lines(score: PairScore) -> list[str]:
    def share(value: float | None) -> str:
        return "-" if value is None else f"{value:.3f}"

    columns = {
        "precision": share(score.precision),
        "recall": share(score.recall),
        "true": str(score.true),
        "false": str(score.false),
        "missed": str(score.missed),
        "in both": str(score.common),
    }
    if score.unjudged:
        columns["unjudged"] = str(score.unjudged)
    widths = [max(len(title), len(value)) for title, value in columns.items()]
    rows = (columns.keys(), columns.values())
    return ["  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)) for row in rows]
