"""Poses in a map as a file."""

from __future__ import annotations

from pathlib import Path

from pomona.atomic import whole_file
from pomona.localize.course import Way
from pomona.recording.poses import write_tum

__all__ = ["write_way"]


def write_way(path: Path, way: Way) -> None:
    """Write `map_from_camera` of the frames that were found as TUM text, time tx ty tz qx qy qz qw."""
    with whole_file(path) as partial:
        write_tum(partial, way.trajectory, "map_from_camera")
