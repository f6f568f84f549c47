"""The shipped fruit detector on photographs and rendered pictures that it was not trained on, each set apart.

Fruits of rows behind have no boxes in the photographs: boxes smaller than 0.6 times the usual labelled fruit of their
picture that match none are neither right nor wrong; one column counts them as wrong. Prints AP50, the recall where the
precision is .90 and .95, precision and recall at the default threshold, and the time for one picture of 640x360 on one
thread. Writes detector.md; with `--draw FOLDER` the boxes too, to look at.
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from training import WIDE
from training.sources import TEST_ROWS, photographs

from benchmarks.results import markdown, share, shared_data, write_text
from pomona.detect.accuracy import Found, Judged, judged
from pomona.detect.drawn_boxes import draw_boxes, drawn_name
from pomona.detect.onnx import OnnxDetector
from pomona.detect.picture_file import read_picture
from pomona.detect.shipped import EXACT, SHIPPED, model_named
from pomona.detect.training.labels import Labelled

LOW_SCORE = 0.001
"""Of the boxes that a curve is drawn through: what is below adds nothing to the area."""

RENDERED_DATES = ("2024-08-09", "2024-08-28")
MIN_VISIBLE, MIN_SIDE_PX = 0.5, 8
"""Of the rendered fruits that must be found; the others are neither wanted nor wrong."""

BALLS = ("TB", "BALL_060", "BALL_120")
"""Ids in the pictures that are balls."""

PHOTOGRAPH = Path(__file__).parents[1] / "testdata" / "pictures" / "apple_81_1259_17kv11r23k_0.jpg"
"""What is looked at against the clock: in noise there would be hundreds of boxes to sort out."""

RUNS = 20
"""Looks of which the fastest counts, in CPU time."""


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks detector", description=__doc__)
    parser.add_argument("--model", help="a file, or the name of a shipped one; else the shipped one and the wide one")
    parser.add_argument("--draw", type=Path, help="folder for pictures with boxes, a folder for each way to look")
    options = parser.parse_args(arguments)
    data = shared_data("detector")
    if data is None:
        return
    models = [options.model] if options.model else [SHIPPED, str(WIDE)]
    tables = [_table(model, augment, data, options.draw) for model in models for augment in (False, True)]
    text = "\n".join([*tables, _times()])
    print(text)
    if not options.model:
        write_text("detector.md", text)


def _table(model: str, augment: bool, data: Path, drawn: Path | None) -> str:
    detector = OnnxDetector.open(model_named(model), min_score=LOW_SCORE, threads=1, augment=augment)
    threshold = detector.signature.min_score or LOW_SCORE
    title = _title(model, augment)
    folder = drawn and drawn / title.replace(", ", "_")
    rows = [_row(name, pictures, complete, detector, threshold, folder) for name, pictures, complete in _sets(data)]
    return f"{title}, boxes from a score of {threshold:.3f} on where no other is said.\n\n{markdown(HEADER, rows)}"


def _title(model: str, augment: bool) -> str:
    return f"{model_named(model).name}, {'two looks' if augment else 'one look'}"


def _times() -> str:
    picture = cv2.resize(read_picture(PHOTOGRAPH), (640, 360), interpolation=cv2.INTER_AREA)
    ways = ((SHIPPED, False), (EXACT, False), (SHIPPED, True), (str(WIDE), False), (str(WIDE), True))
    return markdown(
        ("model", "ms at 640x360, one thread"),
        [(_title(*way), f"{_time_ms(*way, picture):.1f}") for way in ways],
    )


HEADER = (
    *("set", "pictures", "fruits", "AP50", "AP50, small ones wrong", "recall at P .90", "at P .95"),
    *("precision", "recall", "boxes/fruits"),
)


def _row(
    name: str, pictures: list[Labelled], complete: bool, detector: OnnxDetector, threshold: float, drawn: Path | None
) -> tuple[str, ...]:
    looks = list(_found(pictures, detector, threshold, drawn and drawn / name.replace(" ", "_")))
    found, strict = judged(looks), judged(replace(look, smallest_px=0.0) for look in looks)
    precision, recall = found.above(threshold)
    head = (name, str(len(pictures)), str(found.n_fruits))
    if not complete:
        return (*head, *"-----", share(recall), "-")
    curve = (found.average_precision, strict.average_precision, found.recall_at(0.9), found.recall_at(0.95))
    return (*head, *map(share, curve), share(precision), share(recall), f"{_ratio(found, threshold):.2f}")


def _ratio(found: Judged, threshold: float) -> float:
    return float((found.scores >= threshold).sum() / found.n_fruits)


def _found(
    pictures: Iterable[Labelled], detector: OnnxDetector, threshold: float, drawn: Path | None
) -> Iterator[Found]:
    for each in pictures:
        picture = read_picture(each.picture)
        detections = detector.detect(picture)
        if drawn is not None:
            drawn.mkdir(parents=True, exist_ok=True)
            counted = detections.scores >= threshold
            kept = type(detections)(detections.boxes_px[counted], detections.scores[counted])
            draw_boxes(drawn / drawn_name(each.picture.name), picture, kept)
        yield Found(detections, each.boxes_px, each.ignored_px, each.smallest_px)


def _sets(data: Path) -> Iterator[tuple[str, list[Labelled], bool]]:
    """Name, pictures, and whether all fruits in them have boxes; where not, false boxes cannot be told."""
    photos = data / "orchard_photos"
    yield "apples green, rows held out", photographs(photos, "apple_76", TEST_ROWS), True
    yield "apples ripe, rows held out", photographs(photos, "apple_81", TEST_ROWS), True
    yield "pears", photographs(photos, "pear"), True
    for date in RENDERED_DATES:
        yield f"rendered {date}", list(_rendered(data / "rendered_row" / date)), True
    yield "kinect_apples", list(_kinect(data / "kinect_apples")), False
    yield "season_pictures, tagged", list(_season(data / "season_pictures")), False
    yield "field_rgbd", list(_field(data / "field_rgbd")), False


def _labelled(picture: Path, boxes: list[list[float]], ignored: list[list[float]] | None = None) -> Labelled:
    boxes_px, ignored_px = (np.array(rows or [], np.float32).reshape(-1, 4) for rows in (boxes, ignored))
    unknown = np.full(len(boxes_px), np.nan, np.float32)
    return Labelled(picture, boxes_px, unknown, ignored_px, complete=ignored is not None)


def _listed(path: Path, picture: str | None) -> dict[str, list[tuple[str, list[float]]]]:
    """Ids and corners of the boxes of each picture of a table."""
    found = defaultdict(list)
    with path.open(encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            corners = [float(line[name]) for name in ("xmin", "ymin", "xmax", "ymax")]
            found[picture or line["image"]].append((line["id"], corners))
    return found


def _kinect(folder: Path) -> Iterator[Labelled]:
    for picture in sorted(folder.glob("*_color.jpg")):
        rows = _listed(folder / picture.name.replace("_color.jpg", "_boxes.csv"), "only")["only"]
        yield _labelled(picture, [corners for name, corners in rows if name not in BALLS])


def _season(folder: Path) -> Iterator[Labelled]:
    for name, rows in sorted(_listed(folder / "boxes.csv", None).items()):
        yield _labelled(folder / "images" / name, [corners for tag, corners in rows if tag not in BALLS])


def _field(folder: Path) -> Iterator[Labelled]:
    for picture in sorted(folder.glob("*/color_*.png")):
        noted = json.loads((picture.parent / picture.name.replace("color", "annot")).with_suffix(".json").read_text())
        boxes = [
            [*each["points"]["exterior"][0], *each["points"]["exterior"][1]]
            for each in noted["objects"]
            if "apple" in each["classTitle"].lower()
        ]
        yield _labelled(picture, boxes)


def _rendered(recording: Path) -> Iterator[Labelled]:
    """Give boxes around what each fruit shows; how much of it that is, by the disc of its diameter at its depth."""
    camera = json.loads((recording / "calibration.json").read_text())
    with (recording / "fruits.csv").open(encoding="utf-8", newline="") as file:
        diameters_m = {int(line["id"]): float(line["diameter_m"]) for line in csv.DictReader(file)}
    for picture in sorted((recording / "left").iterdir()):
        ids = cv2.imread(str(recording / "ids" / f"{picture.stem}.png"), cv2.IMREAD_UNCHANGED)
        depths = cv2.imread(str(recording / "depth" / f"{picture.stem}.png"), cv2.IMREAD_UNCHANGED) / 1000
        wanted, others = [], []
        for number in np.unique(ids[ids > 0]).tolist():
            y, x = np.nonzero(ids == number)
            depth_m = float(np.median(depths[y, x])) + diameters_m[number] / 4
            disc_px = np.pi / 4 * (camera["fx"] * diameters_m[number] / depth_m) ** 2
            box = [x.min(), y.min(), x.max() + 1, y.max() + 1]
            sides = (box[2] - box[0], box[3] - box[1])
            (wanted if len(x) / disc_px >= MIN_VISIBLE and min(sides) >= MIN_SIDE_PX else others).append(box)
        yield _labelled(picture, wanted, others)


def _time_ms(name: str, augment: bool, picture: NDArray[np.uint8]) -> float:
    detector = OnnxDetector.open(model_named(name), threads=1, augment=augment)
    times_s = []
    for _ in range(RUNS):
        begun_s = time.process_time()
        detector.detect(picture)
        times_s.append(time.process_time() - begun_s)
    return 1000 * min(times_s)
