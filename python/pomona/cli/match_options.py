"""What the verbs that match are told: flags with their help, shared by `match`, `map add` and `config`."""

from __future__ import annotations

import math
from enum import StrEnum

import typer

from pomona.errors import PomonaError


class Method(StrEnum):
    """Which method decides."""

    paper = "paper"
    verified = "verified"


class Scale(StrEnum):
    """What is known of the two clouds' scales."""

    metric = "metric"
    free = "free"


class PlotView(StrEnum):
    """Which picture of a match."""

    row = "row"
    lines = "lines"


class Unit(StrEnum):
    """Unit of the coordinates in the files."""

    m = "m"
    cm = "cm"
    mm = "mm"
    free = "free"


def _is_noise(value: float | None) -> float | None:
    if value is not None and not (math.isfinite(value) and value > 0.0):
        raise PomonaError(f"--noise: found {value}, expected a positive number of metres")
    return value


method_option = typer.Option(None, help="The paper's votes, or constellations verified by log-odds (the default).")
scale_option = typer.Option(None, help="metric: both clouds are in metres (the default); free: their ratio is unknown.")
# Looked at with the flags themselves, so that a farm's plan is refused before anything is scanned for it.
noise_option = typer.Option(
    None,
    "--noise",
    metavar="METRES",
    callback=_is_noise,
    help="Relative noise of the visits per axis, above 0; estimated where not given.",
)
up_option = typer.Option(
    None,
    "--up",
    metavar="X,Y,Z",
    help="The vertical, as a direction. Once: the same in both clouds; twice: in the query, then in the map.",
)
config_option = typer.Option(None, help="Settings as TOML; `pomona config` prints them all.")
per_frame_option = typer.Option(
    None,
    "--per-frame/--whole",
    help="With --method paper: one transform for each frame of the query, pairs merged; or one for the cloud.",
)
threads_option = typer.Option(
    None, help="How many threads to use, at most one a core; the answer is the same for any number."
)


def call_flags(
    method: Method | None,
    scale: Scale | None,
    noise_m: float | None,
    up: list[str] | None,
    per_frame: bool | None,
    threads: int | None,
) -> dict[str, object]:
    """Return the flags under the names of `pomona.match`'s arguments; None where a flag was not given."""
    return {
        "method": method and method.value,
        "scale": scale and scale.value,
        "noise_m": noise_m,
        "up": parsed_up(up) if up else None,
        "per_frame": per_frame,
        "threads": threads,
    }


def parsed_up(texts: list[str]) -> list[list[float]]:
    """Return the vertical in the query and in the map, from the texts of `--up`."""
    if len(texts) > 2:
        raise PomonaError(f"--up: found {len(texts)} directions, expected one for both clouds or query then map")
    directions = [direction(text) for text in texts]
    return directions if len(directions) == 2 else directions * 2


def direction(text: str) -> list[float]:
    """Read a direction given as three numbers."""
    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError:
        raise PomonaError(f"--up: found {text!r}, expected three numbers X,Y,Z") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise PomonaError(f"--up: found {text!r}, expected three finite numbers X,Y,Z")
    return [x, y, z]
