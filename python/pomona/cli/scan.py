"""`pomona scan`: a recording becomes the fruits of one session."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.cli.terminal import say, say_json
from pomona.cli.verbs import INTERRUPTED, Writes
from pomona.likes import KEPT, SCANNED, VIDEO

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Any

    from pomona.recording import Recording
    from pomona.survey import Kept, Survey

SUFFIXES = (".gpkg", ".csv", ".ply")


def _parts_there(output: Path) -> Iterable[Path]:
    from pomona.survey.part_files import parts_there

    return parts_there(output)


def scan(
    recording: Path = typer.Argument(
        metavar="RECORDING", help="Stereo or depth recording, whatever `pomona info` reads."
    ),
    output: Annotated[Path, Writes(SCANNED, also=_parts_there)] = typer.Option(
        ..., "-o", "--output", help="Session to write: .gpkg, or its fruits as .csv or .ply; - is the standard output."
    ),
    detections: Path | None = typer.Option(
        None, metavar="FILE", help="Boxes: our CSV, MOTChallenge text or COCO json; else detections.csv in the folder."
    ),
    model: Path | None = typer.Option(None, metavar="ONNX", help="Detector that finds the boxes, instead of a file."),
    family: str | None = typer.Option(None, help="Family of the model, where the file does not say it."),
    min_score: float | None = typer.Option(None, min=0.0, max=1.0, help="Least confidence of the model's boxes."),
    classes: str | None = typer.Option(None, metavar="NAME,...", help="Classes of the model that are fruits."),
    tiles: str | None = typer.Option(None, metavar="auto|off|NxM", help="Tiles of a large picture for the model."),
    calibration: Path | None = typer.Option(
        None, metavar="FILE", help="Calibration, where it does not lie beside the pictures."
    ),
    poses: Path | None = typer.Option(
        None, metavar="FILE", help="Poses of the left camera, TUM or KITTI text, instead of those recorded."
    ),
    topics: str | None = typer.Option(
        None, metavar="ROLE=TOPIC,...", help="Topics of a bag: left, right, depth, left_info, right_info, poses."
    ),
    depth: str = typer.Option(
        "auto", metavar="auto|stereo|dense|ONNX", help="Depth pictures, else stereo at the fruits; or stereo all over."
    ),
    odometry: bool = typer.Option(False, "--odometry", help="Poses from the pictures, even where they were recorded."),
    retrack: bool = typer.Option(False, "--retrack", help="Track the boxes, even where they have ids."),
    config: Path | None = typer.Option(None, metavar="TOML", help="Settings; `pomona config` prints them all."),
    every: int = typer.Option(1, min=1, metavar="N", help="Take every Nth frame."),
    first: int | None = typer.Option(None, "--from", metavar="FRAME", help="First frame to take, by its number."),
    last: int | None = typer.Option(None, "--to", metavar="FRAME", help="Last frame to take."),
    keep: Annotated[Path | None, Writes(KEPT)] = typer.Option(
        None, metavar="DIR", help="Keep stage results here, and go on from them."
    ),
    preview: Annotated[Path | None, Writes(VIDEO)] = typer.Option(
        None, metavar="MP4", help="Draw boxes, ids and depths on the video."
    ),
    name: str | None = typer.Option(None, help="Name of the session; else the recording's."),
    date: str | None = typer.Option(
        None, metavar="ISO-DATE", help="Day of the visit, 2024-08-09 or 2024-08-09T14:30:00; else the recording's."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Find every fruit of RECORDING once, in 3D, with diameter and covariance, and write the session.

    Poses come with the recording, else from its pictures. Boxes with ids are taken for the fruits that they name,
    others are tracked. Ctrl-C ends the scan early: the session of the frames so far is written, exit code 130.
    """
    from pomona.cli import scan_output
    from pomona.cli.progress import first_interrupt
    from pomona.detect.opening import open_detector
    from pomona.outputs import refuse_inputs
    from pomona.recording import open_recording
    from pomona.recording.bags.topics import parsed_topics
    from pomona.recording.selected import selected
    from pomona.recording.swapped import check_sides
    from pomona.settings import Settings
    from pomona.survey import scan as scan_recording

    _require_writable(output, preview)
    _require_date(date)
    overrides = Settings.load(config, {}).overrides
    chosen = None if topics is None else parsed_topics(topics)
    whole = open_recording(recording, calibration=calibration, topics=chosen, poses=poses)
    _require_drawable(whole, preview)
    detector = open_detector(
        detections, model, whole, family=family, min_score=min_score, classes=_classes(classes), tiles=tiles
    )
    refuse_inputs([path for path in (output, keep, preview) if path], [*whole.inputs(), detector.path])
    opened = selected(whole, every=every, first=first, last=last)
    looks = {"detector": detector.configuration, "depth": depth}
    kept = None if keep is None else _kept(keep, opened, detector.path, looks)
    check_sides(opened)
    choices = {"odometry": odometry, "retrack": retrack}
    with (
        scan_output.scanning(opened, detector.description, told=model is not None) as progress,
        first_interrupt() as stop,
    ):
        survey = scan_recording(
            opened, detector, depth=depth, **choices, config=overrides, keep=kept, progress=progress, stop=stop
        )
    configuration = {"scan": {**looks, **choices, "every": every}, **overrides}
    written = _write(output, survey, opened, name, date, configuration, detector.path)
    _write_extras(keep, preview, opened, survey)
    found = scan_output.summary(opened, survey, written)
    if json:
        say_json(found)
    else:
        say(*scan_output.as_lines(found))
    if survey.stopped is not None:
        raise typer.Exit(INTERRUPTED)


def _classes(text: str | None) -> tuple[str | int, ...] | None:
    return None if text is None else tuple(int(name) if name.isdecimal() else name for name in text.split(","))


def _kept(folder: Path, recording: Recording, detector: Path, looks: dict[str, Any]) -> Kept:
    """Open the folder of what is kept, with all that looking at one frame depends on."""
    from pomona import __version__
    from pomona.survey import Kept
    from pomona.survey.files import identity

    files = identity(dict.fromkeys([*recording.inputs(), detector]))
    return Kept(folder, {"version": __version__, "recording": str(recording.path.resolve()), "files": files, **looks})


def _write(
    output: Path,
    survey: Survey,
    recording: Recording,
    name: str | None,
    date: str | None,
    configuration: dict[str, Any],
    detector: Path,
) -> dict[int, Path]:
    from pomona.orchard.session import GUESSED
    from pomona.survey import write_survey

    day = date or recording.date
    if day is None:
        # A map takes no guessed date by accident: `map add` asks for --date where the session says so.
        configuration = {**configuration, "scan": {**configuration["scan"], "date": GUESSED}}
    return write_survey(
        output,
        survey,
        recording,
        name=name or recording.name,
        date=day or _guessed_date(recording),
        configuration=configuration,
        inputs=[detector],
    )


def _write_extras(keep: Path | None, preview: Path | None, recording: Recording, survey: Survey) -> None:
    from pomona.cli.progress import counting
    from pomona.survey import write_stages
    from pomona.survey.preview import write_preview

    if keep is not None:
        write_stages(keep, survey)
    if preview is not None:
        with counting("drawing", len(recording)) as progress:
            write_preview(preview, recording, survey, progress)


def _require_writable(output: Path, preview: Path | None) -> None:
    """Refuse before the work, not after it."""
    from pomona.streams import is_stream

    if output.suffix or not is_stream(output):
        _require_suffix(output, SUFFIXES)
    if preview is not None:
        _require_suffix(preview, (".mp4",))


def _require_drawable(recording: Recording, preview: Path | None) -> None:
    from pomona.survey.preview import require_preview

    if preview is not None:
        require_preview(recording)


def _require_suffix(path: Path, suffixes: tuple[str, ...]) -> None:
    from pomona.errors import PomonaError

    if path.suffix.lower() not in suffixes:
        raise PomonaError(f"{path}: found suffix {path.suffix!r}, expected {', '.join(suffixes)}")


def _require_date(date: str | None) -> None:
    import datetime

    from pomona.errors import PomonaError

    try:
        if date is not None:
            datetime.datetime.fromisoformat(date)
    except ValueError:
        raise PomonaError(f"--date: found {date!r}, expected ISO 8601, for example 2024-08-09") from None


def _guessed_date(recording: Recording) -> str:
    """Take the day of the newest file, and say so."""
    import datetime
    import warnings

    from pomona.errors import PomonaWarning

    newest_s = max(file.stat().st_mtime for file in recording.inputs())
    day = datetime.datetime.fromtimestamp(newest_s).date().isoformat()
    message = f"{recording.path}: no date noted, took {day} from the age of its files; --date says it better"
    warnings.warn(message, PomonaWarning, stacklevel=2)
    return day
