"""Stereo video: one file with left and right side by side, or two files; decoded frame by frame through PyAV."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.calibration import Calibration
from pomona.recording.calibration.rectification import Optics
from pomona.recording.calibration.rig_files import find_optics
from pomona.recording.card import RecordingCard
from pomona.recording.dates import date_in_name
from pomona.recording.description import describe
from pomona.recording.frame import Frame, chosen_rows
from pomona.recording.pairing import half_period, mutually_nearest
from pomona.recording.video.video_file import VideoFile
from pomona.recording.video.video_runs import VideoPicture

__all__ = ["VIDEO_SUFFIXES", "VideoRecording", "left_and_right", "open_video"]

VIDEO_SUFFIXES = (".mp4", ".mkv", ".avi", ".mov", ".webm", ".ts", ".m4v")


class Video(Protocol):
    """One stream of pictures."""

    @property
    def path(self) -> Path:
        """Its file."""

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Time of each picture, ascending."""

    @property
    def created(self) -> str | None:
        """When it was made, ISO 8601."""

    def pictures(self, rows: Sequence[int] | None = None) -> Iterator[VideoPicture]:
        """Decode picture by picture, all or those of some rows, ascending."""


@dataclass(frozen=True, eq=False, repr=False)
class VideoRecording(RecordingCard):
    """One or two video files; see `Recording` for what it gives.

    Attributes
    ----------
    left, right : Video
        The same when the pictures are side by side.
    pairs : (F, 2) int64
        Rows of left and right that make up the frames, ascending.
    """

    path: Path
    kind: str
    optics: Optics
    left: Video
    right: Video
    pairs: NDArray[np.int64]

    trajectory = None

    @property
    def side_by_side(self) -> bool:
        """Whether one file holds both pictures."""
        return self.left is self.right

    @property
    def calibration(self) -> Calibration:
        """The rectified left camera."""
        return self.optics.calibration

    @property
    def name(self) -> str:
        """The file's or folder's name."""
        return self.path.resolve().stem if self.path.is_file() else self.path.resolve().name

    @property
    def date(self) -> str | None:
        """When the file says it was made, else the date in the name."""
        return self.left.created or date_in_name(self.name)

    @property
    def numbers(self) -> tuple[int, ...]:
        """Rows of the left pictures, from 0, in order of time."""
        return tuple(self.pairs[:, 0].tolist())

    @property
    def recorded_numbers(self) -> tuple[int, ...]:
        """Rows of all left pictures."""
        return tuple(range(len(self.left.times_s)))

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Time of each frame's left picture."""
        return self.left.times_s[self.pairs[:, 0]]

    def __len__(self) -> int:
        return len(self.pairs)

    def frames(self, numbers: Collection[int] | None = None) -> Iterator[Frame]:
        """Decode frame by frame; a frame that cannot be decoded says so when its pictures are asked for."""
        width = self.calibration.width
        left_of, right_of = (slice(0, width), slice(width, 2 * width)) if self.side_by_side else (slice(None),) * 2
        rows = self.pairs[[row for row, _ in chosen_rows(self.numbers, numbers)]].reshape(-1, 2).tolist()
        lefts = self.left.pictures([row for row, _ in rows])
        both = (
            ((picture, picture) for picture in lefts)
            if self.side_by_side
            else zip(lefts, self.right.pictures([row for _, row in rows]), strict=True)
        )
        for (row, _), (left, right) in zip(rows, both, strict=True):
            yield Frame(
                number=row,
                time_s=float(self.left.times_s[row]),
                read_left=functools.partial(_columns, left, left_of, self.optics.left),
                read_right=functools.partial(_columns, right, right_of, self.optics.right),
            )

    def inputs(self) -> Iterator[Path]:
        """Give the videos and the calibration."""
        yield from dict.fromkeys((self.left.path, self.right.path, *self.optics.inputs))

    def description(self) -> dict[str, Any]:
        """Say what was found."""
        counts = {"left": len(self), "right": len(self)}
        return describe(self, self.kind, self.times_s.tolist(), counts)


def _columns(
    picture: VideoPicture, columns: slice, rectify: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]
) -> NDArray[np.uint8]:
    return rectify(np.ascontiguousarray(picture.read()[:, columns]))


def left_and_right(folder: Path) -> tuple[Path, ...]:
    """Videos of a folder: (left, right) by name, else all there are."""
    videos = tuple(sorted(file for file in folder.iterdir() if file.suffix.lower() in VIDEO_SUFFIXES))
    stems = {file.stem.lower(): file for file in videos}
    return (stems["left"], stems["right"]) if len(videos) == 2 and {"left", "right"} <= stems.keys() else videos


def open_video(path: Path, calibration: Path | None = None) -> VideoRecording:
    """Open a file that is side by side, or a folder with `left.mp4` and `right.mp4` or one file side by side.

    Parameters
    ----------
    path : Path
        File or folder.
    calibration : Path, optional
        File or folder; else the one in the folder of the videos.

    Raises
    ------
    PomonaError
        When PyAV, a video or the calibration is missing, the videos differ in size or time, or times go back.
    """
    files = (path,) if path.is_file() else left_and_right(path)
    place = path.parent if path.is_file() else path
    if len(files) == 1:
        both = VideoFile.open(files[0])
        if both.size_px[0] % 2:
            raise PomonaError(f"{path}: found a width of {both.size_px[0]}, expected left and right side by side")
        left, right, size_px = both, both, (both.size_px[0] // 2, both.size_px[1])
    elif len(files) == 2 and files[0].stem.lower() == "left":
        left, right = (VideoFile.open(file) for file in files)
        size_px = left.size_px
        _require_sizes(left, right)
    else:
        raise PomonaError(f"{path}: found {len(files)} videos, expected left and right, or one side by side")
    kind = "side-by-side video" if left is right else "left and right video"
    pairs = np.arange(len(left.times_s)).repeat(2).reshape(-1, 2) if left is right else _pairs(left, right)
    try:
        optics = find_optics(place, size_px, stereo=True, given=calibration)
    except PomonaError as error:
        hint = "; one video is taken for left and right side by side" if left is right else ""
        raise PomonaError(f"{error}{hint}") from None
    return VideoRecording(path, kind, optics, left, right, pairs)


def _require_sizes(left: VideoFile, right: VideoFile) -> None:
    if left.size_px != right.size_px:
        sizes = " and ".join("{}x{}".format(*video.size_px) for video in (left, right))
        raise PomonaError(f"{left.path} and {right.path.name}: found {sizes} pixels, expected equal sizes")


def _pairs(left: VideoFile, right: VideoFile) -> NDArray[np.int64]:
    """Rows (left, right) of pictures that were taken within half a frame; the videos are said to begin together."""
    where = f"{left.path} and {right.path.name}"
    left_s, right_s = (video.times_s - video.times_s[0] for video in (left, right))
    half_s = half_period(left_s)
    pairs = mutually_nearest(left_s, right_s, half_s)
    found = f"found {len(left_s)} and {len(right_s)} frames, {len(pairs)} of them taken within half a frame"
    if 2 * len(pairs) < min(len(left_s), len(right_s)):
        raise PomonaError(f"{where}: {found}: {half_s:.3f} s, expected two cameras that run together")
    if len(pairs) < max(len(left_s), len(right_s)):
        warnings.warn(f"{where}: {found}; the others are left out", PomonaWarning, stacklevel=4)
    return pairs
