"""`pomona localize ORCHARD RECORDING -o poses.tum`: where the camera is in the map, frame by frame."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pomona.cli.localize_options import (
    depth_option,
    detections_option,
    fruits_of_map,
    index_option,
    min_score_option,
    model_option,
    odometry_option,
    single_option,
    unit_option,
)
from pomona.cli.match_options import Unit, config_option, parsed_up, threads_option, up_option
from pomona.cli.terminal import say, say_json
from pomona.cli.verbs import Writes
from pomona.likes import INDEX, POSES


def localize(
    orchard: Path = typer.Argument(metavar="ORCHARD", help="Fruits of the map: an orchard map, a session, or a cloud."),
    recording: Path = typer.Argument(
        metavar="RECORDING", help="Stereo or depth recording, whatever `pomona info` reads."
    ),
    output: Annotated[Path, Writes(POSES)] = typer.Option(
        ...,
        "-o",
        "--output",
        help="Poses to write, map_from_camera: TUM text (.tum, .txt) or KITTI's (.kitti); - is the standard output.",
    ),
    single: bool = single_option,
    detections: Path | None = detections_option,
    model: Path | None = model_option,
    min_score: float | None = min_score_option,
    up: list[str] | None = up_option,
    calibration: Path | None = typer.Option(
        None, metavar="FILE", help="Calibration, where it does not lie beside the pictures."
    ),
    topics: str | None = typer.Option(
        None, metavar="ROLE=TOPIC,...", help="Topics of a bag: left, right, depth, left_info, right_info, poses."
    ),
    depth: str = depth_option,
    odometry: bool = odometry_option,
    index: Annotated[Path | None, Writes(INDEX)] = index_option,
    unit: Unit | None = unit_option,
    config: Path | None = config_option,
    every: int = typer.Option(1, min=1, metavar="N", help="Take every Nth frame."),
    first: int | None = typer.Option(None, "--from", metavar="FRAME", help="First frame to take, by its number."),
    last: int | None = typer.Option(None, "--to", metavar="FRAME", help="Last frame to take."),
    threads: int | None = threads_option,
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Find where the camera of RECORDING is in ORCHARD, frame by frame.

    Exit code 0: some frame was found. 1: none was, a result too. 2: wrong input.
    """
    from pomona.cli import localize_output
    from pomona.detect.opening import open_detector
    from pomona.file_names import require_suffix
    from pomona.localize import Localizer
    from pomona.localize.files import POSE_SUFFIXES, write_way
    from pomona.localize.following import localize as localized
    from pomona.outputs import refuse_inputs
    from pomona.recording import open_recording, selected
    from pomona.recording.bags.topics import parsed_topics
    from pomona.settings import Settings

    require_suffix(output, POSE_SUFFIXES)
    overrides = Settings.load(config, {}).overrides
    vertical = parsed_up(up) if up else None
    chosen = None if topics is None else parsed_topics(topics)
    whole = open_recording(recording, calibration=calibration, topics=chosen, own_poses=not odometry)
    detector = open_detector(detections, model, whole, min_score=min_score)
    refuse_inputs([output], [*whole.inputs(), *detector.inputs])
    taken = selected(whole, every=every, first=first, last=last)
    localizer = Localizer(fruits_of_map(orchard, unit), config=overrides, threads=threads, index=index)
    with localize_output.localizing(taken) as progress:
        way = localized(
            taken, detector, localizer, single=single, depth=depth, odometry=odometry, up=vertical, progress=progress
        )
    write_way(output, way)
    found = localize_output.summary(output, taken, localizer, way)
    localize_output.doubt_metres(found)
    if json:
        say_json({**found, "frames": localize_output.as_rows(way)})
    else:
        say(*localize_output.as_lines(found))
    if not way.found:
        raise typer.Exit(1)
