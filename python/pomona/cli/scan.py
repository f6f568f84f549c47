"""`pomona scan`: a recording becomes the fruits of one session."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.cli.terminal import say, say_json, tell
from pomona.cli.verbs import INTERRUPTED, Writes
from pomona.likes import KEPT, SCANNED, VIDEO

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pomona.recording import Recording
    from pomona.survey import Survey


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
        None,
        metavar="FILE",
        help="Boxes: CSV, MOTChallenge, COCO json, folder of masks; else detections.csv or ids/ there, else --model.",
    ),
    model: Path | None = typer.Option(
        None,
        metavar="ONNX",
        help="Detector instead of boxes: a file, or shipped, which looks where there are no boxes.",
    ),
    family: str | None = typer.Option(None, help="Family of the model, where the file does not say it."),
    min_score: float | None = typer.Option(None, min=0.0, max=1.0, help="Least confidence of the model's boxes."),
    classes: str | None = typer.Option(None, metavar="NAME,...", help="Classes of the model that are fruits."),
    tiles: str | None = typer.Option(None, metavar="auto|off|NxM", help="Tiles of a large picture for the model."),
    augment: bool = typer.Option(
        False,
        "--augment",
        help="Let the model look twice, once at the picture enlarged: fewer false fruits, more time.",
    ),
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
    slam: bool = typer.Option(
        False,
        "--slam",
        help="Poses by the constellations of the fruits too, loops closed, even where some were recorded.",
    ),
    retrack: bool = typer.Option(False, "--retrack", help="Track the boxes, even where they have ids."),
    all_rows: bool = typer.Option(False, "--all-rows", help="Count rows behind the one that is scanned, too."),
    config: Path | None = typer.Option(None, metavar="TOML", help="Settings; `pomona config` prints them all."),
    every: int = typer.Option(1, min=1, metavar="N", help="Take every Nth frame."),
    first: int | None = typer.Option(None, "--from", metavar="FRAME", help="First frame to take, by its number."),
    last: int | None = typer.Option(None, "--to", metavar="FRAME", help="Last frame to take."),
    keep: Annotated[Path | None, Writes(KEPT)] = typer.Option(
        None, metavar="DIR", help="Keep stage results here, and go on from them."
    ),
    crops: bool = typer.Option(True, "--crops/--no-crops", help="Keep a small picture of each fruit in the session."),
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
    others are tracked. Ctrl-C ends the scan early: the session of the frames so far is written where there was none,
    exit code 130.
    """
    from pomona.cli import scan_output
    from pomona.cli.progress import first_interrupt
    from pomona.recording import open_recording
    from pomona.recording.bags.topics import parsed_topics
    from pomona.scanning import prepared, require_session_name
    from pomona.settings import Settings
    from pomona.store.values import iso_date

    require_session_name(output)
    day = None if date is None else iso_date(date, "--date")
    overrides = Settings.load(config, {}).overrides
    chosen = None if topics is None else parsed_topics(topics)
    # What is overridden is not read.
    given = None if odometry or slam else poses
    whole = open_recording(
        recording, calibration=calibration, topics=chosen, poses=given, own_poses=not (odometry or slam)
    )
    _require_drawable(whole, preview)
    ready = prepared(
        whole,
        detections=detections,
        model=model,
        outputs=[path for path in (output, preview) if path],
        depth=depth,
        odometry=odometry,
        slam=slam,
        retrack=retrack,
        all_rows=all_rows,
        every=every,
        first=first,
        last=last,
        keep=keep,
        crops=crops,
        config=overrides,
        family=family,
        min_score=min_score,
        classes=_classes(classes),
        tiles=tiles,
        augment=augment or None,
    )
    opened = ready.recording
    with (
        scan_output.scanning(opened, ready.boxes.description, told=model is not None) as progress,
        first_interrupt() as stop,
    ):
        survey = ready.run(progress, stop)
    if _is_left(output, survey):
        raise typer.Exit(INTERRUPTED)
    written = ready.write(output, survey, name=name, date=day)
    _write_extras(keep, preview, opened, survey)
    found = scan_output.summary(opened, survey, written)
    if json:
        say_json(found)
    else:
        say(*scan_output.as_lines(found, survey))
    if survey.stopped is not None:
        raise typer.Exit(INTERRUPTED)


def _classes(text: str | None) -> tuple[str | int, ...] | None:
    return None if text is None else tuple(int(name) if name.isdecimal() else name for name in text.split(","))


def _write_extras(keep: Path | None, preview: Path | None, recording: Recording, survey: Survey) -> None:
    from pomona.cli.progress import counting
    from pomona.survey import write_stages
    from pomona.survey.files import STAGES
    from pomona.survey.preview import write_preview

    if keep is not None and not any(_is_left(keep / name, survey) for name in STAGES):
        write_stages(keep, survey)
    if preview is not None and not _is_left(preview, survey):
        with counting("drawing", len(recording)) as progress:
            write_preview(preview, recording, survey, progress)


def _is_left(output: Path, survey: Survey) -> bool:
    """Tell, and say, that an interrupted scan replaces nothing here: what is there may be of all frames."""
    from pomona.outputs import holding
    from pomona.survey.part_files import part_files

    there = [] if survey.stopped is None else holding(part_files(output, survey).values())
    if there:
        tell(f"pomona: interrupted after frame {survey.stopped}: {there[0]} is left as it was")
    return bool(there)


def _require_drawable(recording: Recording, preview: Path | None) -> None:
    from pomona.errors import PomonaError
    from pomona.survey.preview import require_preview

    if preview is None:
        return
    if preview.suffix.lower() != ".mp4":
        raise PomonaError(f"{preview}: found suffix {preview.suffix!r}, expected .mp4")
    require_preview(recording)
