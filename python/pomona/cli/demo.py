"""`pomona demo`: the main job in half a minute."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.cli.terminal import say, tell
from pomona.cli.verbs import Writes
from pomona.likes import DEMO

if TYPE_CHECKING:
    from pomona.demo import Demo


def demo(
    output: Annotated[Path, Writes(DEMO)] = typer.Option(
        Path("out/demo"), "-o", "--output", help="Folder for the files it makes."
    ),
) -> None:
    """Find the fruits of a seeded orchard again three weeks later: two visits, one map, one picture."""
    from pomona.cli.progress import working
    from pomona.demo import run_demo

    with working("two visits, one map"):
        made = run_demo(output, tell=lambda line: tell(f"demo: {line}"))
    say(*_as_lines(made))


def _as_lines(made: Demo) -> list[str]:
    first, second = (path.stem for path in made.sessions)
    score = made.score
    share = f"{score.precision:.3f} precision, {score.recall:.3f} recall" if score.precision is not None else "no pairs"
    return [
        f"{made.match.status.value}: {len(made.match.pairs)} fruits of {second} known from {first}, "
        f"{made.n_identities} identities in the map",
        f"  against the truth  {share} ({score.true} true, {score.false} false, {score.missed} missed)",
        f"  growth             {made.growth_mm:+.1f} mm in diameter, median",
        "look at",
        f"  {made.picture}  both visits in one frame: fruits found again, new and missed",
        f"  {made.orchard}  the map; opens in QGIS",
        f"  {made.pairs}  the pairs with their probabilities",
        "go on with",
        f"  pomona match {made.sessions[1]} {made.sessions[0]}",
        f"  pomona map info {made.orchard}",
    ]
