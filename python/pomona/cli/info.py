"""`pomona info`: what a recording holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pomona.cli.terminal import say, say_json

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pomona.recording import Recording
    from pomona.recording.checks.readable import Checked


def info(
    recording: Path = typer.Argument(
        metavar="RECORDING", help="Recording folder, KITTI, TUM RGB-D or EuRoC folder, stereo video, ROS bag or MCAP."
    ),
    calibration: Path | None = typer.Option(
        None, metavar="FILE", help="Calibration, where it does not lie beside the pictures."
    ),
    topics: str | None = typer.Option(
        None, metavar="ROLE=TOPIC,...", help="Topics of a bag: left, right, depth, left_info, right_info, poses."
    ),
    poses: Path | None = typer.Option(None, metavar="FILE", help="Poses of the left camera: TUM or KITTI text."),
    check: bool = typer.Option(
        False,
        "--check",
        help="Decode every picture; name those that cannot be read or show nothing, and swapped or misaligned sides.",
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Say what RECORDING holds: frames, rate, camera, depth error at 1.5 m, pictures, poses, detections.

    With --check the exit code is 1 when a picture cannot be read, the right pictures lie so far off that a scan cannot
    take it out, or depth is not that of the left pictures, and 2 when left and right are swapped or the same.
    """
    from pomona.recording import open_recording
    from pomona.recording.bags.topics import parsed_topics

    opened = open_recording(
        recording, calibration=calibration, topics=None if topics is None else parsed_topics(topics), poses=poses
    )
    found = opened.description()
    faults, depth_fault = _checked(opened) if check else None, None
    if faults is not None:
        for name, frames in (("unreadable", faults.unreadable), ("blank", faults.blank)):
            found[name] = [{"frame": frame, "reason": reason} for frame, reason in frames.items()]
        found["misaligned"] = faults.misaligned
        found["depth_fault"] = depth_fault = _fault_of_depth(opened)
    if json:
        say_json(found)
    else:
        say(*_as_lines(found))
    if faults is not None and (faults.unreadable or faults.is_spoiled or depth_fault is not None):
        raise typer.Exit(1)


def _checked(recording: Recording) -> Checked:
    """Decode everything; swapped sides are an error, because then nothing in the recording is right."""
    from pomona.cli.progress import counting
    from pomona.recording.checks.readable import checked
    from pomona.recording.checks.swapped import check_sides

    check_sides(recording)
    with counting("reading", len(recording)) as progress:
        return checked(recording, progress)


def _fault_of_depth(recording: Recording) -> str | None:
    """Say what is wrong with the depth pictures, by the pictures and boxes that came with the recording."""
    from pomona.survey.depth_check import fault_of_depth

    return fault_of_depth(recording)


def _as_lines(found: dict[str, object]) -> Iterator[str]:
    for name, value in found.items():
        first, *others = _shown(name, value)
        yield f"{name:14} {first}"
        yield from others


def _shown(name: str, value: object) -> list[str]:
    if isinstance(value, list):
        return [str(len(value)), *(f"  {entry['reason']}" for entry in value)]
    return [_in_words(name, value)]


def _in_words(name: str, value: object) -> str:
    if name == "depth_error_m" and isinstance(value, float):
        from pomona.recording.description import DEPTH_M, DISPARITY_ERROR_PX

        return f"{value:.3g} (at {DEPTH_M:g} m, disparity to {DISPARITY_ERROR_PX:g} px)"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        return ", ".join(f"{count} {kind}" for kind, count in value.items())
    if isinstance(value, float):
        return f"{value:g}"
    return "-" if value is None else str(value)
