"""`pomona map info`: what a map or a session holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pomona.amounts import amount
from pomona.cli.map_words import orchard_argument
from pomona.cli.terminal import say, say_json

if TYPE_CHECKING:
    from typing import Any

    from pomona.orchard import OrchardMap


def map_info(orchard: Path = orchard_argument, json: bool = typer.Option(False, "--json", help="Print JSON.")) -> None:
    """Say what a map or a session holds: fruits, visits, what was recognised."""
    from pomona.orchard import OrchardMap

    info = _info(OrchardMap(orchard))
    if json:
        say_json(info)
    else:
        say(*_info_as_lines(info))


def _info(orchard: OrchardMap) -> dict[str, Any]:
    from collections import Counter

    from pomona.orchard import FORMAT_VERSION
    from pomona.orchard.hanging import hang_chances

    fruits, visits = orchard.fruits(), orchard.visits()
    low, high = (fruits.positions.min(axis=0), fruits.positions.max(axis=0)) if len(fruits) else (None, None)
    return {
        "path": str(orchard.path),
        "kind": orchard.kind,
        "format_version": FORMAT_VERSION,
        "n_fruits": len(fruits),
        "n_hanging": round(float(hang_chances(fruits).sum()), 1),
        "n_observations": sum(visit.n_fruits for visit in visits),
        "states": dict(sorted(Counter(fruits.extras["state"]).items())),
        "extent_m": None if low is None or high is None else [low.tolist(), high.tolist()],
        "sessions": [
            {
                "name": visit.name,
                "date": visit.date,
                "part": visit.part,
                "recording": visit.recording,
                "n_fruits": visit.n_fruits,
                "n_matched": visit.n_matched,
                "n_new": visit.n_fruits - visit.n_matched,
                "method": visit.method,
                "log_odds": visit.log_odds,
                "noise_m": visit.noise_m,
                "map_from_session": visit.map_from_session.tolist(),
            }
            for visit in visits
        ],
    }


def _info_as_lines(info: dict[str, Any]) -> list[str]:
    states = ", ".join(f"{count} {state}" for state, count in info["states"].items())
    # Names come last: however long one is, the numbers stay where they are read.
    header: tuple[str, ...] = ("part", "date", "fruits", "matched", "new", "method", "noise", "session")
    rows: list[tuple[str, ...]] = [
        (
            str(visit["part"]),
            visit["date"],
            str(visit["n_fruits"]),
            str(visit["n_matched"]),
            str(visit["n_new"]),
            visit["method"] or "-",
            "-" if visit["noise_m"] is None else f"{100 * visit['noise_m']:.1f} cm",
            visit["name"],
        )
        for visit in info["sessions"]
    ]
    if len({visit["part"] for visit in info["sessions"]}) < 2:
        header, rows = header[1:], [row[1:] for row in rows]
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    table = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in (header, *rows)]
    return [
        f"{info['path']}: {info['kind']}, format {info['format_version']}",
        f"{amount(info['n_fruits'], 'fruit')} seen so far ({states}), {amount(info['n_observations'], 'observation')} "
        f"in {amount(len(rows), 'session')}",
        f"about {info['n_hanging']:.0f} of them hang now; the others went, or were none (how sure: pomona growth)",
        "",
        *(line.rstrip() for line in table),
    ]
