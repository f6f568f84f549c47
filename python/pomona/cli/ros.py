"""`pomona ros ...`: bags of robots with what the localiser would have said."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
from pomona.cli.verbs import Verbs, Writes
from pomona.likes import INDEX, REPLAYED

if TYPE_CHECKING:
    from pomona.ros.replay import Replayed

app = Verbs(help="Bags of robots with what the localiser would have said.", no_args_is_help=True)


@app.callback()
def _ros() -> None:
    """Bags of robots with what the localiser would have said."""


@app.command("replay")
def ros_replay(
    recording: Path = typer.Argument(metavar="IN", help="A bag: .mcap, .bag, .db3 or a ROS 2 folder."),
    output: Annotated[Path, Writes(REPLAYED)] = typer.Argument(
        metavar="OUT.mcap", help="The bag to write; nothing is overwritten, also not with --force."
    ),
    orchard: Path = typer.Option(
        ..., "--map", metavar="ORCHARD", help="Fruits of the map: an orchard map, a session, or a cloud."
    ),
    map_frame: str = typer.Option("map", metavar="NAME", help="What the frame of the map is called."),
    single: bool = single_option,
    detections: Path | None = detections_option,
    model: Path | None = model_option,
    min_score: float | None = min_score_option,
    up: list[str] | None = up_option,
    calibration: Path | None = typer.Option(None, metavar="FILE", help="Calibration instead of the camera_info."),
    topics: str | None = typer.Option(
        None, metavar="ROLE=TOPIC,...", help="Topics: left, right, depth, left_info, right_info, poses."
    ),
    depth: str = depth_option,
    odometry: bool = odometry_option,
    index: Annotated[Path | None, Writes(INDEX)] = index_option,
    unit: Unit | None = unit_option,
    config: Path | None = config_option,
    threads: int | None = threads_option,
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Write bag IN again with poses, transforms, fruits and scenes as a localiser on the robot would have sent them.

    Exit code 0: some frame was found. 1: none was, a result too. 2: wrong input.
    """
    from pomona.cli import localize_output
    from pomona.detect.opening import open_detector
    from pomona.outputs import refuse_inputs
    from pomona.recording import open_recording
    from pomona.recording.bags.topics import parsed_topics
    from pomona.ros.replay import replay, require_bag, require_unused
    from pomona.settings import Settings

    require_unused(output)
    overrides = Settings.load(config, {}).overrides
    chosen = None if topics is None else parsed_topics(topics)
    bag = require_bag(open_recording(recording, calibration=calibration, topics=chosen, own_poses=not odometry))
    detector = open_detector(detections, model, bag, min_score=min_score)
    refuse_inputs([output], [*bag.inputs(), *detector.inputs])
    with localize_output.localizing(bag) as progress:
        done = replay(
            bag,
            detector,
            fruits_of_map(orchard, unit),
            output,
            map_frame=map_frame,
            single=single,
            depth=depth,
            odometry=odometry,
            up=parsed_up(up) if up else None,
            config=overrides,
            threads=threads,
            index=index,
            progress=progress,
        )
    found = localize_output.summary(output, bag, done.localizer, done.way) | _told(done)
    localize_output.doubt_metres(found)
    if json:
        say_json(found)
    else:
        say(*localize_output.as_lines(found), *_lines(found))
    if not done.way.found:
        raise typer.Exit(1)


def _told(done: Replayed) -> dict[str, Any]:
    robot = done.frames.robot
    names = {"map": robot.map, "root": done.frames.root, "base": robot.base, "camera": robot.camera}
    return {"n_copied": done.n_copied, "n_added": done.n_added, "frames": names}


def _lines(found: dict[str, Any]) -> list[str]:
    names = found["frames"]
    return [
        f"  {found['n_copied']:>8} messages of the bag",
        f"  {found['n_added']:>8} messages of ours: {names['map']} -> {names['root']}, pose of {names['base']}",
    ]
