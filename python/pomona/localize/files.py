"""Poses in a map as a file."""

from __future__ import annotations

import warnings
from pathlib import Path

from pomona.amounts import amount
from pomona.errors import PomonaWarning
from pomona.localize.course import Way
from pomona.recording.poses import KITTI_SUFFIX, write_poses

__all__ = ["POSE_SUFFIXES", "write_way"]

POSE_SUFFIXES = (".tum", ".txt", KITTI_SUFFIX)
"""Of poses in a map; the first two are TUM text."""


def write_way(path: Path, way: Way) -> None:
    """Write `map_from_camera` of the frames that were found: TUM text, or KITTI's where the name ends in .kitti."""
    lost = len(way.steps) + len(way.skipped) - len(way.found)
    if path.suffix.lower() == KITTI_SUFFIX and lost:
        without = f"{amount(lost, 'frame')} without a pose"
        message = f"{path}: {without}: its lines are not those of the frames; TUM text says which"
        warnings.warn(message, PomonaWarning, stacklevel=2)
    write_poses(path, way.trajectory, "map_from_camera")
