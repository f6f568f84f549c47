"""The recording folder: pictures in `left/`, `right/`, `depth/`, with `calibration.json` and optional poses."""

from __future__ import annotations

import datetime
import functools
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pomona.errors import PomonaError
from pomona.recording.calibration import Calibration
from pomona.recording.frame import Frame
from pomona.recording.pictures import read_colour, read_depth
from pomona.recording.poses import read_tum
from pomona.trajectory import Trajectory

__all__ = ["FolderRecording"]

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg")

_ISO_DATE = re.compile(r"(\d{4}-\d{2}-\d{2})(?:[T_ ](\d{2})[:-]?(\d{2})(?:[:-]?(\d{2}))?)?")


@dataclass(frozen=True, eq=False)
class FolderRecording:
    """A recording folder; see `Recording` for what it gives.

    Attributes
    ----------
    pictures : mapping
        For each of `left`, `right`, `depth` that exists: frame number to file.
    """

    path: Path
    calibration: Calibration
    numbers: tuple[int, ...]
    pictures: dict[str, dict[int, Path]]
    trajectory: Trajectory | None
    name: str
    date: str | None

    @classmethod
    def open(cls, folder: Path) -> FolderRecording:
        """Open a folder; nothing is decoded yet.

        Raises
        ------
        PomonaError
            When the calibration, the pictures or the poses are missing or do not fit together.
        """
        calibration = Calibration.read(folder / "calibration.json")
        pictures = {kind: _pictures(folder / kind) for kind in ("left", "right", "depth") if (folder / kind).is_dir()}
        numbers = _numbers(folder, pictures)
        if "right" in pictures and calibration.baseline_m is None:
            raise PomonaError(f"{folder / 'calibration.json'}: baseline_m: missing, expected metres: there is a right/")
        about = _about(folder)
        return cls(
            path=folder,
            calibration=calibration,
            numbers=numbers,
            pictures=pictures,
            trajectory=_trajectory(folder / "poses_tum.txt", numbers),
            name=str(about.get("name") or folder.resolve().name),
            date=_date(folder, about),
        )

    def __len__(self) -> int:
        return len(self.numbers)

    def frames(self) -> Iterator[Frame]:
        """Give the frames in order of their numbers."""
        posed = self.trajectory
        for row, number in enumerate(self.numbers):
            yield Frame(
                number=number,
                time_s=None if posed is None else float(posed.times_s[row]),
                session_from_camera=None if posed is None else posed.session_from_camera[row],
                read_left=self._reader("left", number),
                read_right=self._reader("right", number),
                read_depth=self._reader("depth", number),
            )

    def inputs(self) -> Iterator[Path]:
        """Give calibration, poses, detections and depth pictures."""
        for name in ("calibration.json", "recording.json", "poses_tum.txt", "detections.csv"):
            if (self.path / name).is_file():
                yield self.path / name
        yield from self.pictures.get("depth", {}).values()

    def description(self) -> dict[str, Any]:
        """Say what was found."""
        return {
            "recording": str(self.path),
            "name": self.name,
            "date": self.date,
            "frames": len(self),
            "width": self.calibration.width,
            "height": self.calibration.height,
            "fx": self.calibration.fx,
            "fy": self.calibration.fy,
            "baseline_m": self.calibration.baseline_m,
            "pictures": {kind: len(files) for kind, files in self.pictures.items()},
            "poses": self.trajectory is not None,
            "detections": (self.path / "detections.csv").is_file(),
        }

    def _reader(self, kind: str, number: int) -> Any:
        file = self.pictures.get(kind, {}).get(number)
        if file is None:
            return None
        return functools.partial(read_depth if kind == "depth" else read_colour, file, self.calibration)


def _pictures(folder: Path) -> dict[int, Path]:
    """Map frame numbers to picture files; names are numbers, as 0007.png."""
    found: dict[int, Path] = {}
    for file in sorted(folder.iterdir()):
        if file.name.startswith(".") or file.suffix.lower() not in PICTURE_SUFFIXES:
            continue
        if not (file.stem.isascii() and file.stem.isdecimal()):
            raise PomonaError(f"{file}: found the name {file.stem!r}, expected a frame number, for example 0007.png")
        if int(file.stem) in found:
            raise PomonaError(f"{file}: frame {int(file.stem)} is there twice, also as {found[int(file.stem)].name}")
        found[int(file.stem)] = file
    return dict(sorted(found.items()))


def _numbers(folder: Path, pictures: dict[str, dict[int, Path]]) -> tuple[int, ...]:
    """Frame numbers; every kind of picture that has a file has all of them."""
    kinds = {kind: files for kind, files in pictures.items() if files}
    if not ("depth" in kinds or "left" in kinds):
        raise PomonaError(f"{folder}: no pictures found, expected depth/0000.png ... or left/0000.png ...")
    numbers = next(iter(kinds.values())).keys()
    for kind, files in kinds.items():
        odd = numbers ^ files.keys()
        if odd:
            first = next(iter(kinds))
            raise PomonaError(f"{folder}: frame {min(odd)} is only in one of {first}/ and {kind}/, expected it in both")
    return tuple(numbers)


def _trajectory(path: Path, numbers: tuple[int, ...]) -> Trajectory | None:
    if not path.is_file():
        return None
    times_s, session_from_camera = read_tum(path)
    if len(times_s) != len(numbers):
        raise PomonaError(f"{path}: found {len(times_s)} poses, expected one for each of the {len(numbers)} frames")
    return Trajectory(np.array(numbers, np.int64), times_s, session_from_camera)


def _about(folder: Path) -> dict[str, Any]:
    """Read the optional `recording.json`: name, date, source."""
    path = folder / "recording.json"
    if not path.is_file():
        return {}
    try:
        about = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise PomonaError(f"{path}: not JSON ({error})") from None
    if not isinstance(about, dict):
        raise PomonaError(f"{path}: found a JSON {type(about).__name__}, expected an object with name and date")
    return about


def _date(folder: Path, about: dict[str, Any]) -> str | None:
    """Date of the recording: from recording.json, else from the folder's name, as 2024-08-09."""
    if "date" in about:
        try:
            datetime.datetime.fromisoformat(str(about["date"]))
        except ValueError:
            where = folder / "recording.json"
            raise PomonaError(
                f"{where}: date: found {about['date']!r}, expected ISO 8601, as 2021-09-27T11:40:12"
            ) from None
        return str(about["date"])
    found = _ISO_DATE.search(folder.resolve().name)
    if found is None:
        return None
    day, hour, minute, second = found.groups()
    text = day if hour is None else f"{day}T{hour}:{minute}:{second or '00'}"
    try:
        datetime.datetime.fromisoformat(text)
    except ValueError:
        return None
    return text
