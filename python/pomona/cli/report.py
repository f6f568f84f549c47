"""`pomona report`: the orchard over a season as one page to mail."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pomona.cli.page_wishes import Calipers, Classes, Harvest, OrchardMapFile, PackKg, Target, Temperature, Up
from pomona.cli.terminal import say
from pomona.cli.verbs import Writes
from pomona.likes import REPORT


def report(
    orchard: OrchardMapFile,
    output: Annotated[Path, Writes(REPORT)] = typer.Option(..., "-o", "--output", help="HTML file."),
    harvest: Harvest = None,
    temperature: Temperature = None,
    calipers: Calipers = None,
    classes: Classes = None,
    target: Target = None,
    pack_kg: PackKg = 13.0,
    up: Up = None,
) -> None:
    """Write the page of `pomona view` as one file: every fruit, its growth, what to decide. It needs no network."""
    from pomona.cli.page_wishes import page_wishes, tell_guess
    from pomona.cli.progress import working
    from pomona.cli.visit_warnings import warn_of_visits
    from pomona.file_names import require_suffix
    from pomona.viewer.season_report import write_report

    require_suffix(output, (".html", ".htm"))
    wishes = page_wishes(harvest, temperature, calipers, classes, target, pack_kg, up)
    warnings: list[str] = []
    with working(f"telling {orchard}"):
        n_bytes = write_report(orchard, output, wishes, warnings.append)
    warn_of_visits(orchard, warnings)
    tell_guess(orchard, wishes)
    say(f"{output}: {n_bytes / 1e6:.2f} MB, open it in a browser")
