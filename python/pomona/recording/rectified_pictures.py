"""Picture files through the rectification of their camera."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pomona.errors import PomonaError
from pomona.recording.calibration.rectification import Optics
from pomona.recording.pictures import picture_size, read_colour, read_depth

__all__ = ["read_rectified", "size_of_first"]


def read_rectified(kind: str, file: Path, optics: Optics) -> Any:
    """Read a picture file of the kind `left`, `right` or `depth`, and rectify it."""
    if kind == "depth":
        return optics.depth(read_depth(file, optics.calibration))
    return getattr(optics, kind)(read_colour(file, optics.calibration))


def size_of_first(files: tuple[Path, ...]) -> tuple[int, int]:
    """Size of the first picture that can be read."""
    for file in files:
        try:
            return picture_size(file)
        except PomonaError:
            continue
    where = files[0].parent if files else "the recording"
    raise PomonaError(f"{where}: found {len(files)} pictures and none that can be read, expected PNG or JPEG")
