"""`pomona map push` and `pull`: maps and the team's store."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pomona.cli.terminal import say, say_json, tell
from pomona.cli.verbs import Writes
from pomona.likes import PULLED

URL_HELP = "postgresql://USER@HOST:PORT/DATABASE; the password comes from PGPASSWORD, or stands in it."

WAITS = "another push of this map is at work; waiting for its end"


def map_push(
    orchards: list[Path] = typer.Argument(metavar="ORCHARD...", help="Maps (.gpkg)."),
    url: str = typer.Argument(metavar="URL", help=URL_HELP),
    name: str | None = typer.Option(None, help="Name of the map there; else its file's."),
    drop_sessions: bool = typer.Option(
        False, "--drop-sessions", help="Let sessions go that are there and not in the file; else they are refused."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Bring maps into the team's PostGIS, each in one transaction; what has not changed is left alone.

    Earlier versions of rows are kept. Readers see a map as it was, or as it is, never between.
    """
    from dataclasses import asdict

    from pomona.cli.progress import working
    from pomona.errors import PomonaError
    from pomona.team import push_map
    from pomona.team.database_url import parsed_url

    if name is not None and len(orchards) > 1:
        raise PomonaError(f"--name: found it with {len(orchards)} maps, expected one")
    database = parsed_url(url)
    pushed = []
    for orchard in orchards:
        with working(f"pushing {orchard.name}"):
            pushed.append(
                push_map(orchard, database, name=name, drop_sessions=drop_sessions, waits=lambda: tell(WAITS))
            )
        if not json:
            one = pushed[-1]
            changed = f"{one.n_written} rows written, {one.n_ended} ended"
            say(f"{one.name}: {changed if one.n_written or one.n_ended else 'is there as it is'}")
    for role in pushed[-1].roles_without_rights:
        tell(
            f"pomona: warning: {database.shown}: {role} has no rights there: let an administrator CREATE ROLE {role}, "
            "and the store's owner push again"
        )
    if json:
        say_json([asdict(one) for one in pushed])


def map_pull(
    url: str = typer.Argument(metavar="URL", help=URL_HELP),
    name: str = typer.Argument(metavar="MAP", help="Name of the map there."),
    output: Annotated[Path, Writes(PULLED)] = typer.Option(
        ..., "-o", "--output", help="The map to write (.gpkg), where none is yet."
    ),
) -> None:
    """Write a map of the team's PostGIS as a file."""
    from pomona.cli.progress import working
    from pomona.team import pull_map
    from pomona.team.database_url import parsed_url

    with working(f"pulling {name}"):
        count = pull_map(parsed_url(url), name, output)
    say(f"{output}: {count} fruits")
