"""`pomona info`: what a recording holds."""

from __future__ import annotations

from pathlib import Path

import typer


def info(
    recording: Path = typer.Argument(metavar="RECORDING", help="Recording folder."),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Say what RECORDING holds: frames, camera, pictures, poses, detections."""
    from pomona.recording import open_recording

    found = open_recording(recording).description()
    typer.echo(_dumps(found) if json else "\n".join(f"{name:12} {_shown(value)}" for name, value in found.items()))


def _dumps(value: object) -> str:
    import json

    return json.dumps(value)


def _shown(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        return ", ".join(f"{count} {kind}" for kind, count in value.items())
    if isinstance(value, float):
        return f"{value:g}"
    return "-" if value is None else str(value)
