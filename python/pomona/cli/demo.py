"""`pomona demo`: the main job in half a minute."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.amounts import amount
from pomona.cli.terminal import say, tell
from pomona.cli.verbs import Writes
from pomona.likes import DEMO

if TYPE_CHECKING:
    from pomona.demo import Demo
    from pomona.demo_row import DemoVisit, RowDemo
    from pomona.evaluate import PairScore


def demo(
    row: Path | None = typer.Argument(
        None, metavar="[ROW]", help="Recordings with truth, a folder for each visit; else two visits are drawn."
    ),
    output: Annotated[Path, Writes(DEMO)] = typer.Option(
        Path("out/demo"), "-o", "--output", help="Folder for the files it makes."
    ),
) -> None:
    """Find the fruits of an orchard again weeks later: visits, one map, pictures."""
    from pomona.cli.progress import working
    from pomona.demo import run_demo
    from pomona.demo_row import run_row_demo

    with working("visits, one map"):
        if row is None:
            lines = _as_lines(run_demo(output, tell=_told))
        else:
            lines = _lines_of_row(run_row_demo(row, output, tell=_told))
    say(*lines)


def _told(line: str) -> None:
    tell(f"demo: {line}")


def _as_lines(made: Demo) -> list[str]:
    first, second = (path.stem for path in made.sessions)
    return [
        f"{made.match.status.value}: {amount(len(made.match.pairs), 'fruit')} of {second} known from {first}, "
        f"{amount(made.n_identities, 'identity')} in the map",
        f"  against the truth  {_share(made.score)}",
        f"  growth             {made.growth_mm:+.1f} mm in diameter, median",
        "look at",
        f"  {made.picture}  both visits in one frame: fruits found again, new and missed",
        f"  {made.orchard}  the map; opens in QGIS",
        f"  {made.pairs}  the pairs with their probabilities",
        "go on with",
        f"  pomona match {made.sessions[1]} {made.sessions[0]}",
        f"  pomona map info {made.orchard}",
    ]


def _share(score: PairScore) -> str:
    if score.precision is None:
        return "no pairs"
    shares = f"{score.precision:.3f} precision, {score.recall:.3f} recall of what both visits found"
    return f"{shares} ({score.true} true, {score.false} false, {score.missed} missed)"


def _lines_of_row(made: RowDemo) -> list[str]:
    found_again = [line for visit in made.visits[1:] for line in _lines_of_visit(visit)]
    pictures = [f"  {visit.picture}  fruits found again, new and missed" for visit in made.visits if visit.picture]
    return [
        f"{amount(len(made.visits), 'visit')}, {amount(made.n_identities, 'identity')} in the map",
        *found_again,
        "look at",
        f"  {made.same_fruits}  the same fruits on the last two dates",
        *pictures,
        f"  {made.orchard}  the map; opens in QGIS",
        "go on with",
        f"  pomona match {made.visits[-1].session} {made.visits[0].session}",
        f"  pomona growth {made.orchard} -o {made.orchard.parent / 'growth'}",
        f"  pomona map info {made.orchard}",
    ]


def _lines_of_visit(visit: DemoVisit) -> list[str]:
    day, match = visit.session.stem, visit.match
    if match is None or visit.score is None:
        return [f"  {day}: {'no match' if match is None else match.status.value}"]
    return [
        f"  {day}: {len(match.pairs)} of {amount(visit.n_fruits, 'fruit')} known, "
        f"{visit.growth_mm:+.1f} mm since, median",
        f"    against the truth  {_share(visit.score)}",
    ]
