"""Importer of the Azure Kinect captures of one Fuji scene (GRAP-UdL-AT/ak_sw_benchmarker, MIT)."""

from __future__ import annotations

import csv
import datetime
import io
import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pomona.atomic import whole_folder
from pomona.errors import PomonaError
from pomona.reading import read_text, shown
from pomona.recording.calibration import Calibration
from pomona.recording.pictures import read_depth

__all__ = ["DATE", "NOMINAL", "Capture", "import_captures"]

NOMINAL = Calibration(width=1920, height=1080, fx=913.0, fy=913.0, cx=960.0, cy=540.0)
"""Nominal intrinsics: the data set's c = (959.5, 539.5) counts from the centre of the first pixel, ours from its
corner."""

DATE = "2021-09-27"
"""Day of the published captures; their names are the time of the day."""

DETECTION_COLUMNS = ("frame", "xmin", "ymin", "xmax", "ymax", "score", "id")


@dataclass(frozen=True)
class Capture:
    """A capture that was imported."""

    folder: Path
    boxes: int
    has_colour: bool


def import_captures(source: Path, output: Path, date: str = DATE) -> Iterator[Capture]:
    """Make a recording folder `output/HHMMSS` of each capture in `source`; each appears whole or not at all.

    Parameters
    ----------
    source : Path
        Folder with `HHMMSS_depth.png`, `HHMMSS_boxes.csv` and, for some captures, `HHMMSS_color.jpg`.
    output : Path
        Folder for the recordings; made where it does not exist.
    date : str
        Day of the captures, ISO 8601.

    Raises
    ------
    PomonaError
        When there is no capture, a file is missing or wrong, or a folder is already there.
    """
    _moment(date, "")
    names = sorted(file.name.removesuffix("_depth.png") for file in source.glob("?*_depth.png"))
    if not names:
        raise PomonaError(f"{source}: no captures found, expected HHMMSS_depth.png with HHMMSS_boxes.csv")
    taken = [output / name for name in names if (output / name).exists()]
    if taken:
        raise PomonaError(f"{taken[0]}: is already there, expected a new folder")
    output.mkdir(parents=True, exist_ok=True)
    for name in names:
        with whole_folder(output / name) as partial:
            boxes, has_colour = _write(source, name, partial, date)
        yield Capture(output / name, boxes, has_colour)


def _write(source: Path, name: str, folder: Path, date: str) -> tuple[int, bool]:
    depth = source / f"{name}_depth.png"
    read_depth(depth, NOMINAL)
    (folder / "depth").mkdir(parents=True)
    shutil.copyfile(depth, folder / "depth" / "0000.png")
    colour = source / f"{name}_color.jpg"
    if colour.exists():
        (folder / "left").mkdir()
        shutil.copyfile(colour, folder / "left" / "0000.jpg")
    NOMINAL.write(folder / "calibration.json")
    about = {
        "name": f"kinect-apples-{name}",
        "date": _moment(date, name),
        "source": "GRAP-UdL-AT/ak_sw_benchmarker",
    }
    (folder / "recording.json").write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    return _write_detections(source / f"{name}_boxes.csv", folder / "detections.csv"), colour.exists()


def _moment(date: str, name: str) -> str:
    """Put the day and the time in a capture's name together, where the name is a time."""
    try:
        day = datetime.date.fromisoformat(date)
    except ValueError:
        raise PomonaError(f"date: found {date!r}, expected a day as {DATE}") from None
    time = re.fullmatch(r"([01]\d|2[0-3])([0-5]\d)([0-5]\d)", name)
    return day.isoformat() if time is None else f"{day.isoformat()}T{':'.join(time.groups())}"


def _write_detections(boxes: Path, detections: Path) -> int:
    rows = csv.DictReader(io.StringIO(read_text(boxes, "id,xmin,ymin,xmax,ymax"), newline=""))
    with detections.open("w", newline="", encoding="utf-8") as write:
        found = _boxes(boxes, rows)
        writer = csv.DictWriter(write, DETECTION_COLUMNS, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(found)
    return len(found)


def _boxes(path: Path, rows: csv.DictReader[str]) -> list[dict[str, Any]]:
    try:
        found = ",".join(rows.fieldnames or ())
        if not {"id", "xmin", "ymin", "xmax", "ymax"} <= set(rows.fieldnames or ()):
            raise PomonaError(f"{path}: found {shown(found)}, expected id,xmin,ymin,xmax,ymax")
        return [{**row, "frame": 0, "score": 1} for row in rows]
    except csv.Error as error:
        raise PomonaError(f"{path}: line {rows.line_num}: not a CSV text ({error})") from None
