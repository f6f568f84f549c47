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
    from pomona.survey import Part, Progress, Survey

SUFFIXES = (".gpkg", ".csv", ".ply")

INTERRUPTED = 130
"""Exit code of what Ctrl-C ended, as shells have it."""


def scan(
    recording: Path = typer.Argument(
        metavar="RECORDING", help="Stereo video, folder of stereo or depth pictures, bag: whatever `pomona info` knows."
    ),
    output: Path = typer.Option(..., "-o", "--output", help="Session to write: .gpkg, or its fruits as .csv or .ply."),
    detections: Path | None = typer.Option(
        None, metavar="FILE", help="Boxes: our CSV, MOTChallenge text or COCO json; else detections.csv in the folder."
    ),
    calibration: Path | None = typer.Option(
        None, metavar="FILE", help="Calibration, where it does not lie beside the pictures."
    ),
    stereo: bool = typer.Option(False, "--stereo", help="Depth from left and right, even where depth was recorded."),
    odometry: bool = typer.Option(False, "--odometry", help="Poses from the pictures, even where they were recorded."),
    every: int = typer.Option(1, min=1, metavar="N", help="Take every Nth frame."),
    first: int | None = typer.Option(None, "--from", metavar="FRAME", help="First frame to take, by its number."),
    last: int | None = typer.Option(None, "--to", metavar="FRAME", help="Last frame to take."),
    keep: Path | None = typer.Option(None, metavar="DIR", help="Keep stage results here, and go on from them."),
    preview: Path | None = typer.Option(None, metavar="MP4", help="Draw boxes, ids and depths on the video."),
    name: str | None = typer.Option(None, help="Name of the session; else the recording's."),
    date: str | None = typer.Option(
        None, metavar="ISO-DATE", help="Day of the visit, 2024-08-09 or 2024-08-09T14:30:00; else the recording's."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Find every fruit of RECORDING once, in 3D, with diameter and covariance, and write the session.

    More than one frame needs poses, and an id for each box. Ctrl-C ends the scan early: the session of the frames so
    far is written, exit code 130.
    """
    from pomona.cli.progress import first_interrupt
    from pomona.detect.opening import open_detections
    from pomona.recording import open_recording
    from pomona.recording.selected import selected
    from pomona.survey import Kept, write_stages, write_survey
    from pomona.survey import scan as scan_recording
    from pomona.survey.preview import require_preview

    _require_writable(output)
    if preview is not None:
        _require_suffix(preview, (".mp4",))
    _require_date(date)
    whole = open_recording(recording, calibration=calibration)
    boxes = detections or recording / "detections.csv"
    detector = open_detections(boxes, whole.calibration, whole.numbers)
    if preview is not None:
        require_preview(whole)
    opened = selected(whole, every=every, first=first, last=last)
    choices = {"stereo": stereo, "odometry": odometry}
    kept = None if keep is None else Kept(keep, _made_from(opened, [boxes], stereo))
    with _progress(opened) as progress, first_interrupt() as stop:
        survey = scan_recording(opened, detector, **choices, keep=kept, progress=progress, stop=stop)
    configuration = {"scan": {**choices, "boxes": str(boxes.resolve()), "every": every}}
    written = write_survey(
        output,
        survey,
        opened,
        name=name or opened.name,
        date=date or _date(opened),
        configuration=configuration,
        inputs=[boxes],
    )
    if keep is not None:
        write_stages(keep, survey)
    if preview is not None:
        _draw(preview, opened, survey)
    summary = _summary(opened, survey, written)
    typer.echo(_dumps(summary) if json else _as_text(summary))
    if survey.stopped is not None:
        raise typer.Exit(INTERRUPTED)


def _made_from(recording: Recording, boxes: list[Path], stereo: bool) -> dict[str, Any]:
    """Say all that looking at one frame depends on."""
    from pomona import __version__
    from pomona.survey.files import identity

    return {
        "version": __version__,
        "recording": str(recording.path.resolve()),
        "files": identity(dict.fromkeys([*recording.inputs(), *boxes])),
        "stereo": stereo,
    }


def _draw(preview: Path, recording: Recording, survey: Survey) -> None:
    from pomona.cli.progress import counting
    from pomona.survey.preview import write_preview

    with counting("drawing", len(recording)) as progress:
        write_preview(preview, recording, survey, progress)


def _require_writable(output: Path) -> None:
    """Refuse before the work, not after it."""
    _require_suffix(output, SUFFIXES)


def _require_suffix(path: Path, suffixes: tuple[str, ...]) -> None:
    from pomona.errors import PomonaError

    if path.suffix.lower() not in suffixes:
        raise PomonaError(f"{path}: found suffix {path.suffix!r}, expected {', '.join(suffixes)}")
    if not path.resolve().parent.is_dir():
        raise PomonaError(f"{path}: the folder {path.parent} is not there")


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
    """Show frames, rate, fruits and time left on the standard error of a terminal."""
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
        TextColumn("{task.fields[rate]:.1f} frames/s, {task.fields[fruits]} fruits"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("scan", total=len(recording), fruits=0, rate=0.0)

        def show(done: int, _total: int, fruits: int) -> None:
            elapsed_s = bar.tasks[task].elapsed or 0.0
            bar.update(task, completed=done, fruits=fruits, rate=done / elapsed_s if elapsed_s else 0.0)

        yield show


def _summary(recording: Recording, survey: Survey, written: list[Path]) -> dict[str, Any]:
    import numpy as np

    diameters_m = np.concatenate([part.cloud.diameters_m for part in survey.parts])
    return {
        "output": [str(path) for path in written],
        "recording": str(recording.path),
        "n_frames": len(recording),
        "n_skipped_frames": len(survey.skipped),
        "stopped_after_frame": survey.stopped,
        "n_boxes": survey.detections,
        "n_refused": {reason.value: count for reason, count in sorted(survey.refused.items())},
        "n_fruits": sum(len(part.cloud) for part in survey.parts),
        "parts": [_of_part(part, path) for part, path in zip(survey.parts, written, strict=True)],
        "median_diameter_mm": float(1000 * np.median(diameters_m)) if len(diameters_m) else None,
    }


def _of_part(part: Part, path: Path) -> dict[str, Any]:
    frames = part.trajectory.frames.tolist()
    return {
        "output": str(path),
        "first_frame": min(frames, default=None),
        "last_frame": max(frames, default=None),
        "n_fruits": len(part.cloud),
        "began": part.began,
    }


def _dumps(value: Any) -> str:
    import json

    return json.dumps(value)


def _as_text(summary: dict[str, Any]) -> str:
    size = summary["median_diameter_mm"]
    fruits = f"{summary['n_fruits']} fruits" + ("" if size is None else f", median diameter {size:.1f} mm")
    lines = [f"{summary['output'][0]}: {fruits}, from {summary['n_boxes']} boxes in {summary['n_frames']} frames"]
    lines += [f"  {count} boxes without a place: {reason}" for reason, count in summary["n_refused"].items()]
    if summary["stopped_after_frame"] is not None:
        lines.append(f"  stopped after frame {summary['stopped_after_frame']}: what was found till then is written")
    if len(summary["parts"]) > 1:
        lines += [
            f"  {part['output']}: frames {part['first_frame']} to {part['last_frame']}, {part['n_fruits']} fruits"
            + (f": {part['began']}" if part["began"] else "")
            for part in summary["parts"]
        ]
    return "\n".join(lines)
