"""Calibrations of all programs that we read."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from fuzz.bundle import packed, packed_folder, unpacked
from pomona.recording.calibration.rig_files import find_optics
from recording_maker import FIELDS

SIZES = {"zed": (672, 376)}


def seeds() -> list[bytes]:
    """One of each kind, written as its program does."""
    from test_rig_files import WRITERS, write_zed

    found = [packed("json", {"calibration.json": json.dumps({**FIELDS, "baseline_m": 0.12}).encode()})]
    for kind, write in {**WRITERS, "zed": write_zed}.items():
        with tempfile.TemporaryDirectory() as place:
            write(Path(place))
            found.append(packed_folder(kind, Path(place)))
    return found


def target(content: bytes) -> None:
    """Rectify for the size that the seeds are of."""
    with unpacked(content) as (kind, folder):
        find_optics(folder, SIZES.get(kind, (640, 480)), stereo=True)
