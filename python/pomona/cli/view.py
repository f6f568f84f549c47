"""`pomona view`: the orchard over a season in a browser, as the map is now."""

from __future__ import annotations

import typer

from pomona.cli.page_wishes import Calipers, Classes, Harvest, OrchardMapFile, PackKg, Target, Temperature, Up
from pomona.cli.terminal import say


def view(
    orchard: OrchardMapFile,
    port: int = typer.Option(8123, min=0, max=65535, help="0 takes any free one."),
    host: str = typer.Option(
        "127.0.0.1", metavar="ADDRESS", help="Where to listen; other machines that know the token can look then."
    ),
    token: str | None = typer.Option(
        None, metavar="TEXT", help="What visitors must know; made up anew where other machines can look."
    ),
    harvest: Harvest = None,
    temperature: Temperature = None,
    calipers: Calipers = None,
    classes: Classes = None,
    target: Target = None,
    pack_kg: PackKg = 13.0,
    up: Up = None,
) -> None:
    """Show a map in the browser: the row in 3D, every fruit and its growth, what to decide. Ctrl-C ends it.

    Only this machine can look, and nothing is written; with --host all who have the address that is printed, with its
    token. When a visit is added the page shows it after a reload.
    """
    from pomona.cli.page_wishes import page_wishes, tell_guess
    from pomona.cli.progress import working
    from pomona.viewer.own_address import own_address
    from pomona.viewer.page_server import listening, page_app, serve
    from pomona.viewer.token import token_for

    wishes = page_wishes(harvest, temperature, calipers, classes, target, pack_kg, up)
    with listening(host, port) as taken:
        listened, number = taken.getsockname()[:2]
        known = token_for(listened, token)
        with working(f"telling {orchard}"):
            app = page_app(orchard, wishes, known)
        tell_guess(orchard, wishes)
        address = own_address(taken)
        place = f"http://{f'[{address}]' if ':' in address else address}:{number}/"
        say(place if known is None else f"{place}?token={known}")
        serve(app, taken)
