"""`pomona map check`: whether a map is whole."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pomona.cli.map_words import orchard_argument
from pomona.cli.terminal import say, say_json

if TYPE_CHECKING:
    pass


def map_check(orchard: Path = orchard_argument, json: bool = typer.Option(False, "--json", help="Print JSON.")) -> None:
    """Check that a map or a session is whole. Exit code 0: it is. 1: a problem a line. 2: not a map of ours."""
    from pomona.cli.progress import working
    from pomona.orchard import problems

    with working(f"checking {orchard.name}"):
        found = problems(orchard)
    if json:
        say_json({"problems": found})
    else:
        say(*(found or ["ok"]))
    if found:
        raise typer.Exit(1)
