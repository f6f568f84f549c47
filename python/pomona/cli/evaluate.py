"""`pomona evaluate ...`: results against truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pomona.cli.terminal import say, say_json
from pomona.cli.verbs import Verbs

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud
    from pomona.evaluate import PairScore

app = Verbs(help="Compare results with the truth.", no_args_is_help=True)


@app.callback()
def _evaluate() -> None:
    """Compare results with the truth."""


@app.command("match")
def evaluate_match(
    query: Path = typer.Argument(
        metavar="QUERY", help="The cloud that was matched, with true ids (.csv, .ply, .gpkg)."
    ),
    map: Path = typer.Argument(metavar="MAP", help="The cloud it was matched with, with true ids."),
    pairs: Path = typer.Argument(
        metavar="PAIRS", help="What `pomona match` wrote with -o or --json; - reads the standard input."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON instead of a table."),
) -> None:
    """Precision and recall of a match: a pair is right where both fruits carry the same id."""
    from pomona.cloud import FruitCloud
    from pomona.evaluate import score_pairs
    from pomona.pairs import read_pairs

    in_query, in_map = FruitCloud.read(query, unit="free"), FruitCloud.read(map, unit="free")
    truth = _true_ids(query, in_query), _true_ids(map, in_map)
    score = score_pairs(read_pairs(pairs, in_query, in_map), *truth)
    if json:
        say_json(_as_json(score))
    else:
        say(*_as_lines(score))


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
