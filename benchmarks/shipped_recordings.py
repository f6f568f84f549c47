"""The shipped recordings of one five-tree row: `python -m benchmarks.shipped_recordings FOLDER [PACKED]`.

They need a graphics card, or `photo` for `photo-gpu` below and some hours of a processor.

What is in FOLDER already is not rendered again, whenever the run was stopped. With PACKED, what is complete is packed
there as a user would have it: one side-by-side video a visit, its calibration, and the truth as small tables.
"""

from __future__ import annotations

import datetime
import shutil
import sys
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from pomona.recording.poses import read_tum, write_tum
from pomona.render.filming import Filming, film
from pomona.synth.living import RowDesign
from pomona.trajectory import Trajectory

SEED = 20
PAIRS = 48
RATE_HZ = 10

DESIGN = RowDesign(n_trees=5, clear_of_posts=False)
"""As it was filmed: five of its fruits stand in a post or a wire, one with its middle."""

VISITS = (
    Filming(DESIGN, datetime.date(2024, 8, 9), SEED, "tractor", "sun", PAIRS, renderer="photo-gpu"),
    Filming(DESIGN, datetime.date(2024, 8, 28), SEED, "tractor-back", "overcast", PAIRS, renderer="photo-gpu"),
    Filming(DESIGN, datetime.date(2024, 9, 12), SEED, "angle", "dusk", PAIRS, renderer="photo-gpu"),
)
"""Three dates: the light, the direction, the height and where the camera looks differ."""

TABLES = ("calibration.json", "fruits.csv", "boxes.csv")

MOST_BYTES = 15_000_000
"""Of all three together, since they lie in the repository."""

ENCODING = {"crf": "22", "preset": "slow", "x264-params": "threads=1"}
"""One thread, so that the same pictures give the same bytes."""


def main(folder: Path, packed: Path | None) -> None:
    for visit in VISITS:
        film(visit, folder / visit.day.isoformat(), tell=_progress(visit))
    if packed is not None:
        for visit in VISITS:
            pack(folder / visit.day.isoformat(), packed / visit.day.isoformat())
        size = sum(path.stat().st_size for path in packed.rglob("*") if path.is_file())
        sys.stdout.write(f"{packed}: {size / 1e6:.1f} MB\n")
        if size > MOST_BYTES:
            raise SystemExit(f"{packed}: found {size} bytes, expected at most {MOST_BYTES}")


def pack(recording: Path, packed: Path) -> None:
    """Make a folder with one side-by-side video and the tables; what is there already is replaced."""
    shutil.rmtree(packed, ignore_errors=True)
    packed.mkdir(parents=True)
    for name in TABLES:
        shutil.copyfile(recording / name, packed / name)
    _, session_from_camera = read_tum(recording / "poses_tum.txt")
    write_tum(packed / "poses_tum.txt", in_the_video(session_from_camera))
    with av.open(str(packed / "row.mp4"), "w") as container:
        container.metadata["creation_time"] = f"{packed.name}T10:00:00Z"
        stream = container.add_stream("libx264", rate=Fraction(RATE_HZ), options=ENCODING)
        stream.pix_fmt = "yuv420p"
        stream.width, stream.height = 2 * VISITS[0].size_px[0], VISITS[0].size_px[1]
        for left in sorted((recording / "left").iterdir()):
            both = np.hstack([cv2.imread(str(recording / eye / left.name)) for eye in ("left", "right")])
            container.mux(stream.encode(av.VideoFrame.from_ndarray(both, format="bgr24")))
        container.mux(stream.encode())


def in_the_video(session_from_camera: NDArray[np.float64]) -> Trajectory:
    """Give poses, (N, 4, 4), the times that the frames have in the video: the drive was as long as its path."""
    frames = np.arange(len(session_from_camera))
    return Trajectory(frames, frames / RATE_HZ, session_from_camera)


def _progress(visit: Filming):
    def tell(done: int, total: int) -> None:
        now = datetime.datetime.now().astimezone()
        sys.stderr.write(f"{now:%H:%M:%S} {visit.day}: {done} of {total} pairs\n")

    return tell


if __name__ == "__main__":
    main(*[Path(argument) for argument in sys.argv[1:3]], *[None] * (3 - len(sys.argv)))
