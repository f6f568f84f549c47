"""Recordings with truth: the Kinect captures imported, the rendered row with boxes from its id pictures."""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.detect.from_file import FileDetector
from pomona.recording import Recording, open_recording
from pomona.recording.formats.kinect_apples import import_captures
from pomona.survey import Survey, scan

DATES = ("2024-08-09", "2024-08-28")
"""Both visits of the rendered row."""

MIN_VISIBLE = 0.30
MIN_WIDTH_PX = 7
"""Boxes of the rendered row: fruits that show more than 30 % of their disc, in a box at least 7 px wide."""


@dataclass(frozen=True)
class TrueBox:
    """Box around the visible part of a rendered fruit, and how much of its disc that is."""

    frame: int
    fruit: str
    box_px: tuple[int, int, int, int]
    visible: float


def scanned(folder: Path) -> Survey:
    recording = open_recording(folder)
    return scan(recording, detector(folder, recording))


def detector(folder: Path, recording: Recording) -> FileDetector:
    return FileDetector.read(folder / "detections.csv", recording.calibration, recording.recorded_numbers)


def scanned_captures(data: Path, scratch: Path) -> dict[str, FruitCloud]:
    """Fruits of the four Kinect captures, in the order of the day."""
    captures = import_captures(data / "kinect_apples", scratch)
    return {capture.folder.name: scanned(capture.folder).cloud for capture in captures}


def rendered_truth(source: Path) -> FruitCloud:
    return FruitCloud.read(source / "fruits.csv")


def with_true_boxes(
    source: Path, folder: Path, *, pictures: Sequence[str] = ("depth",), names: bool = True
) -> list[TrueBox]:
    """Make a recording folder of a rendered one, with detections.csv made from ids/, with the true ids or without."""
    folder.mkdir(parents=True)
    for kind in pictures:
        (folder / kind).symlink_to((source / kind).resolve())
    for name in ("calibration.json", "poses_tum.txt"):
        (folder / name).write_bytes((source / name).read_bytes())
    boxes = list(true_boxes(source))
    with (folder / "detections.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("frame", "xmin", "ymin", "xmax", "ymax", "score", *(("id",) if names else ())))
        writer.writerows((box.frame, *box.box_px, 1, *((box.fruit,) if names else ())) for box in boxes)
    return boxes


def true_boxes(source: Path) -> Iterator[TrueBox]:
    recording, truth = open_recording(source), rendered_truth(source)
    row_of = {name: row for row, name in enumerate(truth.ids or ())}
    for frame in recording.frames():
        for name, x, y in visible_pixels(source, frame.number):
            row = row_of[name]
            depth_m = in_camera(frame.session_from_camera, truth.positions[row])[2]
            radius_px = recording.calibration.fx * truth.diameters_m[row] / 2 / depth_m
            visible = len(x) / (np.pi * radius_px**2)
            if visible > MIN_VISIBLE and x.max() + 1 - x.min() >= MIN_WIDTH_PX:
                box_px = (int(x.min()), int(y.min()), int(x.max()) + 1, int(y.max()) + 1)
                yield TrueBox(frame.number, name, box_px, float(visible))


def visible_pixels(source: Path, frame: int) -> Iterator[tuple[str, NDArray[np.int64], NDArray[np.int64]]]:
    """Give each fruit of a rendered frame with the columns and rows of the pixels that show it."""
    ids = cv2.imread(str(source / "ids" / f"{frame:04d}.png"), cv2.IMREAD_UNCHANGED)
    y, x = np.nonzero(ids)
    names, first = np.unique(ids[y, x][(order := np.argsort(ids[y, x], kind="stable"))], return_index=True)
    for name, columns, rows in zip(names, np.split(x[order], first[1:]), np.split(y[order], first[1:]), strict=True):
        yield str(name), columns, rows


def in_camera(session_from_camera: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.float64]:
    return (point - session_from_camera[:3, 3]) @ session_from_camera[:3, :3]
