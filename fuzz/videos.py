"""Videos side by side, and recordings of a ZED."""

from __future__ import annotations

import tempfile
from pathlib import Path

from fuzz.bundle import packed_folder, unpacked
from pomona.recording import open_recording
from pomona.recording.checks.readable import checked


def seeds() -> list[bytes]:
    """A few frames in the containers of the usual cameras."""
    from test_recording_svo2 import CONF, SERIAL, write_svo2
    from test_recording_video import write_calibration, write_video

    found = []
    for name, codec in (("row.mp4", "libx264"), ("row.mkv", "mjpeg"), ("row.avi", "mjpeg"), ("row.ts", "libx264")):
        with tempfile.TemporaryDirectory() as place:
            write_calibration(Path(place))
            write_video(Path(place) / name, 4, codec=codec)
            found.append(packed_folder(name, Path(place)))
    with tempfile.TemporaryDirectory() as place:
        write_svo2(Path(place) / "row.svo2", n_frames=3)
        (Path(place) / f"SN{SERIAL}.conf").write_text(CONF, encoding="utf-8")
        found.append(packed_folder("svo2", Path(place)))
    return found


def target(content: bytes) -> None:
    """Open the video and look at every frame."""
    with unpacked(content) as (_, folder):
        for file in sorted(folder.glob("row.*")):
            recording = open_recording(file)
            recording.description()
            checked(recording)
