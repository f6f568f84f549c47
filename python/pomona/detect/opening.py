"""From what the user has, boxes or a model, to a detector."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pomona.detect.from_file import FileDetector
from pomona.recording import Calibration

__all__ = ["open_detections"]


def open_detections(path: str | Path, calibration: Calibration, numbers: Sequence[int]) -> FileDetector:
    """Open a file of boxes or tracks of any kind that `FileDetector.read` knows; it is told by what is in it."""
    return FileDetector.read(Path(path), calibration, numbers)
