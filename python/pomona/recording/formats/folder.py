"""The recording folder: pictures in `left/`, `right/`, `depth/`, with `calibration.json` and optional poses."""

from __future__ import annotations

import datetime
import functools
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from pomona.calendar_days import expected_day
from pomona.errors import PomonaError
from pomona.reading import parsed_json, read_text, shown
from pomona.recording.calibration import Calibration
from pomona.recording.calibration.rectification import Optics
from pomona.recording.calibration.rig_files import find_optics
from pomona.recording.card import RecordingCard
from pomona.recording.dates import date_in_name
from pomona.recording.description import describe
from pomona.recording.formats.frame_times import times_beside_poses, times_in
from pomona.recording.frame import Frame, chosen_rows
from pomona.recording.pictures import UnreadablePictureError, numbered_pictures, picture_size
from pomona.recording.poses import read_tum
from pomona.recording.poses_in_time import posed_rows, poses_at
from pomona.recording.rectified_pictures import read_rectified, size_of_first
from pomona.trajectory import Trajectory

__all__ = ["FolderRecording"]

ABOUT = "an object with name and date"

NOT_READ = (".tif", ".tiff", ".exr", ".npy", ".npz", ".pgm", ".pfm", ".raw", ".bin")
"""Suffixes of pictures, of depth most often, that are not read: they are named, and not passed over."""


@dataclass(frozen=True, eq=False, repr=False)
class FolderRecording(RecordingCard):
    """A recording folder; see `Recording` for what it gives.

    Attributes
    ----------
    pictures : mapping
        For each of `left`, `right`, `depth` that exists: frame number to file.
    times_s : (F,) float64 or None
        Time of each frame: those of `times.txt`, else of the poses that came with it.
    listing : tuple of Path
        Files that say when the frames were taken and where the camera was.
    """

    path: Path
    optics: Optics
    numbers: tuple[int, ...]
    pictures: dict[str, dict[int, Path]]
    times_s: NDArray[np.float64] | None
    trajectory: Trajectory | None
    name: str
    listing: tuple[Path, ...]
    date: str | None

    @classmethod
    def open(cls, folder: Path, calibration: Path | None = None, *, own_poses: bool = True) -> FolderRecording:
        """Open a folder; nothing is decoded yet.

        Parameters
        ----------
        folder : Path
            With `left/`, `right/`, `depth/`.
        calibration : Path, optional
            File or folder of the calibration; else `calibration.json` in the folder, else another kind there.
        own_poses : bool
            Whether `poses_tum.txt` is read for more than the times of the frames.

        Raises
        ------
        PomonaError
            When the calibration, the pictures or the poses are missing or do not fit together.
        """
        kinds = (kind for kind in ("left", "right", "depth") if (folder / kind).is_dir())
        pictures = {kind: _pictures(folder / kind) for kind in kinds}
        numbers = _numbers(folder, pictures)
        optics = _optics(folder, pictures, calibration)
        about = _about(folder)
        timing, poses = folder / "times.txt", folder / "poses_tum.txt"
        times_s, trajectory = times_in(timing, len(numbers)), None
        if not own_poses:
            times_s = times_beside_poses(poses, len(numbers)) if times_s is None else times_s
        elif poses.is_file():
            trajectory = _trajectory(poses, numbers, times_s, optics)
            numbers, times_s = tuple(trajectory.frames.tolist()), trajectory.times_s
        return cls(
            path=folder,
            optics=optics,
            numbers=numbers,
            pictures=pictures,
            times_s=times_s,
            trajectory=trajectory,
            name=str(about.get("name") or folder.resolve().name),
            date=_date(folder, about),
            listing=tuple(file for file in (timing, *((poses,) if own_poses else ())) if file.is_file()),
        )

    @property
    def calibration(self) -> Calibration:
        """The rectified left camera."""
        return self.optics.calibration

    @property
    def recorded_numbers(self) -> tuple[int, ...]:
        """Numbers of all frames that have a picture."""
        return _all_numbers(self.pictures)

    def __len__(self) -> int:
        return len(self.numbers)

    def frames(self, numbers: Collection[int] | None = None) -> Iterator[Frame]:
        """Give the frames in order of their numbers, or those of some numbers."""
        posed = self.trajectory
        for row, number in chosen_rows(self.numbers, numbers):
            yield Frame(
                number=number,
                time_s=None if self.times_s is None else float(self.times_s[row]),
                session_from_camera=None if posed is None else posed.session_from_camera[row],
                read_left=self._reader("left", number),
                read_right=self._reader("right", number),
                read_depth=self._reader("depth", number),
            )

    def inputs(self) -> Iterator[Path]:
        """Give calibration, poses, detections and pictures."""
        yield from self.optics.inputs
        yield from self.listing
        for name in ("recording.json", "detections.csv"):
            if (self.path / name).is_file():
                yield self.path / name
        for files in self.pictures.values():
            yield from files.values()

    def description(self) -> dict[str, Any]:
        """Say what was found."""
        times_s = None if self.times_s is None else self.times_s.tolist()
        counts = {kind: len(files) for kind, files in self.pictures.items()}
        return describe(self, "recording folder", times_s, counts)

    def _reader(self, kind: str, number: int) -> Any:
        files = self.pictures.get(kind)
        if not files:
            return None
        if number not in files:
            suffix = next(iter(files.values())).suffix
            return functools.partial(_not_there, self.path / kind / f"{number:04d}{suffix}")
        return functools.partial(read_rectified, kind, files[number], self.optics)


def _pictures(folder: Path) -> dict[int, Path]:
    """Map frame numbers to picture files; raise where all that is there are pictures of a kind that is not read."""
    pictures = numbered_pictures(folder)
    other = next((file for file in sorted(folder.iterdir()) if file.suffix.lower() in NOT_READ), None)
    if not pictures and other is not None:
        kind = "16-bit PNG" if folder.name == "depth" else "PNG or JPEG"
        raise PomonaError(f"{folder}: found {shown(other.name)}, expected {kind}: {folder.name}/0000.png ...")
    return pictures


def _not_there(file: Path) -> NoReturn:
    raise UnreadablePictureError(f"{file}: not there, but the other pictures of this frame are")


def _numbers(folder: Path, pictures: dict[str, dict[int, Path]]) -> tuple[int, ...]:
    """Numbers of all frames; one that lacks a picture stays, so that it is named when the picture is asked for."""
    kinds = {kind: files for kind, files in pictures.items() if files}
    if not ("depth" in kinds or "left" in kinds):
        raise PomonaError(f"{folder}: no pictures found, expected depth/0000.png ... or left/0000.png ...")
    if not set.intersection(*(set(files) for files in kinds.values())):
        ranges = ", ".join(f"{kind}/ {min(files)} to {max(files)}" for kind, files in kinds.items())
        raise PomonaError(f"{folder}: found frames {ranges}, expected the same numbers in each folder")
    return _all_numbers(pictures)


def _all_numbers(pictures: dict[str, dict[int, Path]]) -> tuple[int, ...]:
    return tuple(sorted(set().union(*pictures.values())))


def _optics(folder: Path, pictures: dict[str, dict[int, Path]], calibration: Path | None) -> Optics:
    own = folder / "calibration.json"
    files = tuple(next(files for files in pictures.values() if files).values())
    if calibration is None and own.is_file():
        optics = Optics.of(Calibration.read(own), own)
        _require_size(own, optics.calibration, files)
    else:
        size_px = size_of_first(files)
        optics = find_optics(folder, size_px, stereo="right" in pictures, given=calibration)
    if "right" in pictures and optics.calibration.baseline_m is None:
        raise PomonaError(f"{own}: baseline_m: missing, expected metres: there is a right/")
    return optics


def _require_size(own: Path, calibration: Calibration, files: tuple[Path, ...]) -> None:
    """Compare with the first picture; when that cannot be read it will be named when it is asked for."""
    try:
        size_px = picture_size(files[0])
    except PomonaError:
        return
    if size_px != calibration.size_px:
        found, expected = ("{}x{}".format(*size) for size in (calibration.size_px, size_px))
        raise PomonaError(f"{own}: width, height: found {found}, expected {expected} as {files[0].name} is")


def _trajectory(
    path: Path, numbers: tuple[int, ...], times_s: NDArray[np.float64] | None, optics: Optics
) -> Trajectory:
    """Poses of the frames that have one: by time, or one for each where nothing but the poses has times."""
    known_s, known = read_tum(path)
    rows = np.arange(len(numbers))
    if times_s is not None:
        poses, has_pose = poses_at(times_s, known_s, known)
        rows = posed_rows(path, has_pose, clocks=(times_s, known_s))
        known_s, known = times_s[rows], poses[rows]
    elif len(known_s) != len(numbers):
        expected = f"one for each of the {len(numbers)} frames, or the times of the frames in times.txt"
        raise PomonaError(f"{path}: found {len(known_s)} poses, expected {expected}")
    known[:, :3, :3] = known[:, :3, :3] @ optics.rectified_from_left.T
    return Trajectory(np.array(numbers, np.int64)[rows], known_s, known)


def _about(folder: Path) -> dict[str, Any]:
    """Read the optional `recording.json`: name, date, source."""
    path = folder / "recording.json"
    if not path.is_file():
        return {}
    about = parsed_json(str(path), read_text(path, ABOUT), ABOUT)
    if not isinstance(about, dict):
        raise PomonaError(f"{path}: found a JSON {type(about).__name__}, expected {ABOUT}")
    return about


def _date(folder: Path, about: dict[str, Any]) -> str | None:
    """Date of the recording: from recording.json, else from the folder's name, as 2024-08-09."""
    if "date" in about:
        try:
            datetime.datetime.fromisoformat(str(about["date"]))
        except ValueError:
            where = folder / "recording.json"
            expected = expected_day(about["date"], "ISO 8601, as 2021-09-27T11:40:12")
            raise PomonaError(f"{where}: date: found {shown(about['date'])}, {expected}") from None
        return str(about["date"])
    return date_in_name(folder.resolve().name)
