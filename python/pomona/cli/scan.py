"""`pomona scan`: a recording becomes the fruits of one session."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from typing import Any

    from pomona.recording import Recording
    from pomona.survey import Progress, Survey

SUFFIXES = (".gpkg", ".csv", ".ply")


def scan(
    recording: Path = typer.Argument(
        metavar="RECORDING", help="Recording with depth: a recording folder or a TUM RGB-D folder."
    ),
    output: Path = typer.Option(..., "-o", "--output", help="Session to write: .gpkg, or its fruits as .csv or .ply."),
    detections: Path | None = typer.Option(
        None, metavar="CSV", help="Boxes: frame,xmin,ymin,xmax,ymax,score[,id]; else detections.csv in the folder."
    ),
    name: str | None = typer.Option(None, help="Name of the session; else the recording's."),
    date: str | None = typer.Option(
        None, metavar="ISO-DATE", help="Day of the visit, 2024-08-09 or 2024-08-09T14:30:00; else the recording's."
    ),
    calibration: Path | None = typer.Option(
        None, metavar="FILE", help="Calibration, where it does not lie beside the pictures."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Lift the boxes of RECORDING to fruits in 3D, with diameters and covariances, and write the session.

    More than one frame needs poses and an id for each box.
    """
    from pomona.detect.from_file import FileDetector
    from pomona.recording import open_recording
    from pomona.survey import require_depth
    from pomona.survey import scan as scan_recording

    _require_writable(output)
    _require_date(date)
    opened = open_recording(recording, calibration=calibration)
    require_depth(opened)
    boxes = detections or recording / "detections.csv"
    detector = FileDetector.read(boxes, opened.calibration, opened.numbers)
    with _progress(opened) as progress:
        survey = scan_recording(opened, detector, progress=progress)
    if output.suffix.lower() == ".gpkg":
        _write_session(output, opened, survey, boxes, name or opened.name, date or _date(opened))
    else:
        survey.cloud.write(output)
    summary = _summary(opened, survey, output)
    typer.echo(_dumps(summary) if json else _as_text(summary))


def _require_writable(output: Path) -> None:
    """Refuse before the work, not after it."""
    from pomona.errors import PomonaError

    if output.suffix.lower() not in SUFFIXES:
        raise PomonaError(f"{output}: found suffix {output.suffix!r}, expected {', '.join(SUFFIXES)}")
    if not output.resolve().parent.is_dir():
        raise PomonaError(f"{output}: the folder {output.parent} is not there")


def _require_date(date: str | None) -> None:
    import datetime

    from pomona.errors import PomonaError

    try:
        if date is not None:
            datetime.datetime.fromisoformat(date)
    except ValueError:
        raise PomonaError(f"--date: found {date!r}, expected ISO 8601, for example 2024-08-09") from None


def _date(recording: Recording) -> str:
    """Take the date that was recorded; else the day of the newest file, and say so."""
    import datetime
    import warnings

    from pomona.errors import PomonaWarning

    if recording.date is not None:
        return recording.date
    newest_s = max(file.stat().st_mtime for file in recording.inputs())
    day = datetime.datetime.fromtimestamp(newest_s).date().isoformat()
    message = f"{recording.path}: no date noted, took {day} from the age of its files; --date says it better"
    warnings.warn(message, PomonaWarning, stacklevel=2)
    return day


@contextmanager
def _progress(recording: Recording) -> Iterator[Progress | None]:
    """Show frames, sightings and time left on the standard error of a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    columns = (
        "scanning",
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[seen]} seen"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("scan", total=len(recording), seen=0)
        yield lambda done, total, seen: bar.update(task, completed=done, total=total, seen=seen)


def _write_session(output: Path, recording: Recording, survey: Survey, boxes: Path, name: str, date: str) -> None:
    import hashlib

    from pomona.orchard import write_session

    files = dict.fromkeys([*recording.inputs(), boxes])
    write_session(
        output,
        survey.cloud,
        name=name,
        date=date,
        recording=str(recording.path.resolve()),
        trajectory=survey.trajectory,
        configuration={"scan": {"detections": str(boxes.resolve())}},
        input_hashes={_shown(file, recording): hashlib.sha256(file.read_bytes()).hexdigest() for file in files},
    )


def _shown(file: Path, recording: Recording) -> str:
    return str(file.relative_to(recording.path)) if file.is_relative_to(recording.path) else str(file)


def _summary(recording: Recording, survey: Survey, output: Path) -> dict[str, Any]:
    import numpy as np

    diameters_m = survey.cloud.diameters_m
    return {
        "output": str(output),
        "recording": str(recording.path),
        "n_frames": len(recording),
        "n_skipped_frames": len(survey.skipped),
        "n_boxes": survey.detections,
        "n_refused": {reason.value: count for reason, count in sorted(survey.refused.items())},
        "n_fruits": len(survey.cloud),
        "median_diameter_mm": float(1000 * np.median(diameters_m))
        if diameters_m is not None and len(diameters_m)
        else None,
    }


def _dumps(value: Any) -> str:
    import json

    return json.dumps(value)


def _as_text(summary: dict[str, Any]) -> str:
    size = summary["median_diameter_mm"]
    fruits = f"{summary['n_fruits']} fruits" + ("" if size is None else f", median diameter {size:.1f} mm")
    lines = [f"{summary['output']}: {fruits}, from {summary['n_boxes']} boxes in {summary['n_frames']} frames"]
    lines += [f"  {count} boxes without a fruit: {reason}" for reason, count in summary["n_refused"].items()]
    return "\n".join(lines)
