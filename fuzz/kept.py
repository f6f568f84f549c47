"""Frames that `--keep` left in a folder."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from fuzz.bundle import packed_folder, unpacked
from pomona.detect import Detections
from pomona.recording import Frame
from pomona.survey.depth import Lifted
from pomona.survey.kept import Kept
from pomona.survey.seeing import Look


def seeds() -> list[bytes]:
    """A frame with two boxes, as it is kept."""
    with tempfile.TemporaryDirectory() as place:
        Kept(Path(place), {"recording": "row"}).remembering(_see)(Frame(0))
        return [packed_folder("kept", Path(place))]


def _see(frame: Frame) -> Look:
    boxes = Detections(np.array([[1.0, 2, 3, 4], [2, 2, 5, 6]]), np.array([0.9, 0.5]), ("a", "b"))
    ones = np.ones(2)
    lifted = Lifted(np.arange(2), np.ones((2, 3)), np.stack([np.eye(3)] * 2), ones, ones, ones, ones, {})
    return Look(frame.number, boxes, lifted, None)


def target(content: bytes) -> None:
    """Take the frame up again."""
    with unpacked(content) as (_, folder):
        Kept(folder, {"recording": "row"}).remembering(_see)(Frame(0))
