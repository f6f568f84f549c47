"""`pomona map trees`: rows and trees, found from the fruits or given."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pomona.amounts import amount
from pomona.cli.map_words import orchard_argument
from pomona.cli.terminal import say, say_json

if TYPE_CHECKING:
    from pomona.orchard.map_trees import TreeRow


def map_trees(
    orchard: Path = orchard_argument,
    trees: Path | None = typer.Option(
        None, "--trees", metavar="FILE", help="Trees that are known: a table (.csv) with x,y,z in the map, and name."
    ),
    spacing_m: float | None = typer.Option(None, "--spacing", metavar="METRES", help="Between trunks, where known."),
    segment_m: float | None = typer.Option(
        None, "--segments", metavar="METRES", help="Part rows in which no trees can be told into lengths of this."
    ),
    renumber: bool = typer.Option(False, "--renumber", help="Count from 1 again; else trees keep their numbers."),
    forget: bool = typer.Option(
        False,
        "--forget",
        help="Look for trees anew: those that --trees gave or fruits told before stay else, and drawn ones do.",
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Find the rows and trees of ORCHARD from its fruits, number the trees along their row and write them.

    Trees that are drawn in the map, that --trees gives or that sessions name in a column `tree` are taken as they are.
    In a hedge or a wall, where fruits hang evenly, no tree can be told; that is said.
    """
    from dataclasses import asdict

    from pomona.cli.progress import working
    from pomona.orchard.given_trees import read_trees
    from pomona.orchard.map_trees import find_trees

    given = () if trees is None else read_trees(trees)
    with working(f"finding trees in {orchard.name}"):
        rows = find_trees(
            orchard,
            given=given,
            spacing_m=spacing_m,
            segment_m=segment_m,
            renumber=renumber,
            forget=forget,
        )
    if json:
        say_json([{**asdict(row), "log_odds": _finite(row.log_odds)} for row in rows])
    else:
        say(*(line for row in rows for line in _row_as_lines(row)) if rows else ("no row of fruits: too few",))


def _finite(number: float) -> float | None:
    """Return a number for JSON, which knows none that is not finite."""
    return number if abs(number) < float("inf") else None


def _row_as_lines(row: TreeRow) -> list[str]:
    if row.kind == "none":
        return [
            f"row: {row.n_fruits} fruits, no trees can be told; --segments METRES parts it, --trees FILE names them"
        ]
    on_trees = sum(n_fruits for _, _, n_fruits in row.trees)
    others = [("no tree", row.n_fruits - on_trees)] if on_trees < row.n_fruits else []
    count = len(row.trees)
    what = amount(count, "segment") if row.kind == "segments" else f"{amount(count, 'tree')}, {row.source}"
    return [
        f"row {row.number}: {amount(row.n_fruits, 'fruit')}, {what}, {row.spacing_m:.2f} m apart",
        *(
            f"  {name}: {amount(n_fruits, 'fruit')}"
            for name, n_fruits in [*((tree[0], tree[2]) for tree in row.trees), *others]
        ),
    ]
