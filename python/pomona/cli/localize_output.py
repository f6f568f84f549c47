"""What `pomona localize` shows: progress on the standard error, the summary on the standard output."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pomona.amounts import amount

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

    from pomona.localize import Localizer, Step, Way
    from pomona.localize.following import Progress
    from pomona.recording import Recording


@contextmanager
def localizing(recording: Recording) -> Iterator[Progress | None]:
    """Show frames, those found, and the time left on the standard error of a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    found = TextColumn("{task.fields[found]} found")
    columns = ("localising", BarColumn(), MofNCompleteColumn(), found, TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("localize", total=len(recording), found=0)
        yield lambda done, n_found: bar.update(task, completed=done, found=n_found)


def summary(output: Path, recording: Recording, localizer: Localizer, way: Way) -> dict[str, Any]:
    """Put in numbers what was found and where it was written."""
    import numpy as np

    from pomona.localize.metres import length_in_map

    sigmas_m = [step.found.sigma_m for step in way.found]
    return {
        "output": str(output),
        "recording": str(recording.path),
        "n_map": len(localizer),
        "n_frames": len(recording),
        "n_found": len(way.found),
        "n_tracked": sum(step.found.tracked for step in way.found),
        "n_skipped_frames": len(way.skipped),
        "statuses": dict(sorted(way.statuses.items())),
        "median_sigma_m": float(np.median(sigmas_m)) if sigmas_m else None,
        "length_in_map": length_in_map(way.steps, localizer.map_m),
    }


def doubt_metres(found: dict[str, Any]) -> None:
    """Warn of metres that are not the map's."""
    from pomona.cli.terminal import tell
    from pomona.localize.metres import length_told

    if found["length_in_map"] is not None:
        tell(f"pomona: warning: {found['recording']}: {length_told(found['length_in_map'])}")


def as_rows(way: Way) -> list[dict[str, Any]]:
    """Say of every frame what was found; covariances as in `pomona.Localization`."""
    return [_row(step) for step in way.steps]


def _row(step: Step) -> dict[str, Any]:
    found = step.found
    pose = found.map_from_camera
    known = {} if pose is None else {"map_from_camera": pose.tolist(), "covariance": found.covariance.tolist()}
    return {
        "frame": step.frame,
        "time_s": step.time_s,
        "status": str(found.status),
        "tracked": found.tracked,
        "n_fruits": step.n_fruits,
        "n_pairs": len(found.pairs),
        "log_odds": found.log_odds if found.log_odds == found.log_odds else None,
        **known,
    }


def as_lines(found: dict[str, Any]) -> list[str]:
    """Say the same in words."""
    among = amount(found["n_map"], "fruit")
    frames = f"{found['n_found']} of {found['n_frames']} frames found among {among}"
    sigma_m = found["median_sigma_m"]
    sure = "" if sigma_m is None else f", to {1000 * sigma_m:.0f} mm (median of what the poses say of themselves)"
    lines = [f"{found['output']}: {frames}{sure}"]
    lines += [f"  {count:>8} {status}" for status, count in found["statuses"].items()]
    if found["n_skipped_frames"]:
        lines.append(f"  {found['n_skipped_frames']:>8} frames skipped: a picture cannot be read")
    return lines
