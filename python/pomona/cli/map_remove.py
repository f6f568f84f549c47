"""`pomona map remove`: a session out of the map again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pomona.amounts import amount
from pomona.cli.map_words import orchard_argument
from pomona.cli.terminal import say, say_json, tell

if TYPE_CHECKING:
    from typing import Any

    from pomona.orchard import Removed


def map_remove(
    orchard: Path = orchard_argument,
    session: str = typer.Argument(metavar="SESSION", help="Name of the session, as `pomona map info` gives it."),
    yes: bool = typer.Option(False, "--yes", help="Do it; without, only say what would go."),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Undo `map add`: take SESSION and what only it saw out of ORCHARD.

    The other fruits fall back to where the last of the remaining sessions saw them. Exit code 0: removed. 1: ORCHARD
    has no such session, or no --yes was given, and the map stays as it was. 2: wrong input.
    """
    from pomona.orchard import remove_session

    removed = remove_session(orchard, session, dry=not yes)
    done = removed is not None and yes
    if json:
        say_json({**_removed_as_json(session, removed), "removed": done})
    else:
        say(_removed_as_text(session, removed))
    if removed is not None and not yes:
        tell(f"pomona: {orchard}: nothing is removed without --yes")
    if not done:
        raise typer.Exit(1)


def _removed_as_json(session: str, removed: Removed | None) -> dict[str, Any]:
    from dataclasses import asdict

    return {"session": session, **({} if removed is None else asdict(removed))}


def _removed_as_text(session: str, removed: Removed | None) -> str:
    if removed is None:
        return f"{session}: no session of that name in the map, which stays as it was"
    return (
        f"{session}: takes away {amount(removed.n_observations, 'observation')}, with them "
        f"{amount(removed.n_gone, 'fruit')} that nobody else saw; {amount(removed.n_changed, 'fruit')} fall back; "
        f"left: {amount(removed.n_left, 'session')}"
    )
