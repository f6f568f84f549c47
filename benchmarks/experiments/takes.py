"""A video as a user would have it: the pictures of both eyes, in the order in which they are played, and no truth."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.experiments.boxes import boxes_of, clear, write_boxes
from benchmarks.recordings import TrueBox
from pomona.recording.poses import read_tum

EYES = ("left", "right")

A_TREE_M = 1.2
"""Between two trunks."""


@dataclass(frozen=True)
class Take:
    """How a video is played.

    Attributes
    ----------
    video : str
        Name of the video.
    backwards : bool
        Played from its end, without the frames that stand before the tree there.
    """

    video: str
    backwards: bool = False

    @property
    def name(self) -> str:
        """Unique among all takes."""
        return f"{self.video}-backwards" if self.backwards else self.video


@dataclass(frozen=True, eq=False)
class LaidOut:
    """A take as a recording folder.

    Attributes
    ----------
    folder : Path
        Linked pictures and calibration.
    boxes : list of TrueBox
        Whatever shows of a fruit, with frames of the take.
    """

    folder: Path
    boxes: list[TrueBox]

    @property
    def true_boxes(self) -> Path:
        """File of the clear ones, without names."""
        return self.folder.with_suffix(".csv")


def played(take: Take, video: Path) -> list[int]:
    """Frames of the video in the order of the take."""
    _, row_from_camera = read_tum(video / "poses_tum.txt")
    frames = list(range(len(row_from_camera)))
    if not take.backwards:
        return frames
    along_m = row_from_camera[:, 0, 3]
    return [frame for frame in reversed(frames) if along_m[frame] < along_m.max() - A_TREE_M]


def laid_out(take: Take, video: Path, folder: Path) -> LaidOut:
    """Make the folder of a take anew; linking takes no time."""
    place, frames = folder / "takes" / take.name, played(take, video)
    shutil.rmtree(place, ignore_errors=True)
    for eye in EYES:
        (place / eye).mkdir(parents=True)
        for number, frame in enumerate(frames):
            (place / eye / f"{number:04d}.png").symlink_to((video / eye / f"{frame:04d}.png").resolve())
    for name in ("calibration.json", "recording.json"):
        (place / name).write_bytes((video / name).read_bytes())
    number_of = {frame: number for number, frame in enumerate(frames)}
    boxes = [replace(box, frame=number_of[box.frame]) for box in boxes_of(video) if box.frame in number_of]
    there = LaidOut(place, boxes)
    write_boxes(there.true_boxes, clear(boxes))
    return there
