"""`pomona map merge`: two maps of overlapping parts become one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.cli.map_words import change_as_text, orchard_argument
from pomona.cli.match_options import (
    config_option,
    threads_option,
)
from pomona.cli.terminal import say, say_json
from pomona.cli.verbs import Writes
from pomona.likes import MERGED

if TYPE_CHECKING:
    from typing import Any

    from pomona.orchard import Merged


def map_merge(
    orchard: Path = orchard_argument,
    other: Path = typer.Argument(metavar="OTHER", help="The map whose sessions come; it stays as it is."),
    output: Annotated[Path | None, Writes(MERGED)] = typer.Option(
        None, "--output", "-o", help="Write the merged map here (.gpkg) and leave ORCHARD as it is."
    ),
    config: Path | None = config_option,
    threads: int | None = threads_option,
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Join two maps that overlap: all sessions of OTHER come to ORCHARD.

    The result is that of adding each session. Fruits of ORCHARD keep their ids, those of OTHER get ids of ORCHARD.
    Trees, the place on Earth and the history of OTHER come too; what ORCHARD has its own of is left out and told. A
    session that is in both comes once; one whose name another has gets another name, which is told. Exit code 0:
    merged. 1: OTHER was not found in ORCHARD, and nothing is written. 2: wrong input.
    """
    from pomona.cli.progress import working
    from pomona.orchard import merge_maps
    from pomona.settings import Settings

    settings = Settings.load(config, {"threads": threads})
    with working(f"merging {other.name} into {orchard.name}"):
        merged = merge_maps(orchard, other, output=output, settings=settings)
    if json:
        say_json(_merged_as_json(other, merged))
    else:
        say(*_merged_as_lines(other, merged))
    if not merged.is_merged:
        raise typer.Exit(1)


def _merged_as_json(other: Path, merged: Merged) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "other": str(other),
        "merged": merged.is_merged,
        "status": None if merged.match is None else merged.match.status.value,
        "sessions": list(merged.sessions),
        "shared": list(merged.shared),
        "renamed": dict(merged.renamed),
        "n_fruits": len(merged.fruit_ids),
        "n_known": merged.n_known,
        "fruit_ids": merged.fruit_ids,
        "changes": [asdict(change) for change in merged.changes],
        "left_out": list(merged.left_out),
    }


def _merged_as_lines(other: Path, merged: Merged) -> list[str]:
    if not merged.is_merged:
        assert merged.match is not None
        return [f"{other}: {merged.match.status.value}, not found in the map, which stays as it was"]
    n_fruits, n_came, n_shared = len(merged.fruit_ids), len(merged.sessions), len(merged.shared)
    known = f"{merged.n_known} of {n_fruits} fruits were known"
    if merged.match is not None and not merged.n_known:
        # Two maps are one by what hung in the same places, and of that nothing is left only where a winter passed.
        known = f"found by where {len(merged.match.pairs)} fruits hung; none was known, for none outlives the winter"
    return [
        f"{other}: sessions that came: {n_came}, in both: {n_shared}; {known}",
        *(f"{name}: another session is called so, here it is {now}" for name, now in merged.renamed.items()),
        *map(change_as_text, merged.changes),
        *(f"left out: {what}" for what in merged.left_out),
    ]
