"""From pixels to fruits with nothing given: the shipped recordings, scanned with the shipped detector, dates matched.

A box that was found is that of the true fruit whose box it overlaps by half; a reported fruit is the one that most of
its boxes show. Counted against the fruits that five frames and more show by over 30 %, at least 7 px wide; fruits that
are reported although fewer frames show them so are hidden ones. Places are told after the best rigid motion onto the
truth, diameters by how many lie within 1.645 of their own standard deviations. MOTA is over the same fruits, without
the boxes of other ones. Each date is matched with the ones before: recall over the fruits that count on both. Writes
shipped.md.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import sys
import time
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.lifting import rigid_residuals
from benchmarks.results import markdown, share, write_text
from benchmarks.tracking_scores import mot_scores
from pomona import match
from pomona.cloud import FruitCloud
from pomona.detect.accuracy import SAME_IOU, overlaps
from pomona.detect.onnx import OnnxDetector
from pomona.detect.shipped import SHIPPED, model_named
from pomona.recording import open_recording
from pomona.survey import Part, scan

ROW = Path(__file__).parents[1] / "examples" / "row"

MIN_VIEWS, MIN_VISIBLE, MIN_WIDTH_PX = 5, 0.3, 7

NINETY = 1.645
"""Standard deviations either way of a normal distribution within which nine in ten lie."""


@dataclass(frozen=True)
class TrueBoxes:
    """Boxes of one frame: (N, 4) in pixels, whose they are, and which of them must be found."""

    boxes_px: NDArray[np.float64]
    names: tuple[str, ...]
    wanted: NDArray[np.bool_]


@dataclass(frozen=True)
class Scanned:
    """One date: what was found, and what was there."""

    date: str
    part: Part
    n_parts: int
    true: dict[int, TrueBoxes]
    fruits: FruitCloud
    cpu_s: float

    @property
    def countable(self) -> set[str]:
        """Fruits that must be reported."""
        views = Counter(
            name
            for boxes in self.true.values()
            for name, wanted in zip(boxes.names, boxes.wanted, strict=True)
            if wanted
        )
        return {name for name, n in views.items() if n >= MIN_VIEWS}

    def shown(self) -> list[str]:
        """Name the fruit that each box of the part shows; "" for none."""
        boxes = self.part.boxes
        names = np.full(len(boxes.frames), "", object)
        for frame, there in self.true.items():
            rows = np.flatnonzero(boxes.frames == frame)
            if len(rows) and len(there.names):
                like = overlaps(boxes.boxes_px[rows], there.boxes_px)
                best = like.argmax(axis=1)
                right = like.max(axis=1) >= SAME_IOU
                names[rows[right]] = np.array(there.names, object)[best[right]]
        return list(names)

    def true_ids(self) -> list[str]:
        """Name each reported fruit by what most of its boxes show; "" where that is none."""
        votes: list[Counter[str]] = [Counter() for _ in range(len(self.part.cloud))]
        for name, fruit in zip(self.shown(), self.part.boxes.fruits.tolist(), strict=True):
            if fruit >= 0:
                votes[fruit][name] += 1
        return [vote.most_common(1)[0][0] if vote else "" for vote in votes]


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks shipped", description=__doc__)
    parser.add_argument("--row", type=Path, default=ROW, help="folder with a folder for each date")
    parser.add_argument("--model", default=SHIPPED)
    parser.add_argument("--augment", action="store_true", help="let it look at each picture twice")
    options = parser.parse_args(arguments)
    detector = OnnxDetector.open(model_named(options.model), augment=options.augment)
    scans = [scanned(visit, detector) for visit in sorted(options.row.iterdir()) if visit.is_dir()]
    first = markdown(
        ("date", "true", "reported", "count error", "missed", "split", "hidden", "false", "MOTA", "median mm",
         "95 % mm", "diameter bias mm", "diameters in their 90 %", "CPU ms a frame"),
        [fruit_row(found) for found in scans],
    )  # fmt: skip
    second = markdown(
        ("matched", "with", "answer", "pairs", "precision", "fruits on both dates", "recall"),
        [match_row(query, map) for map, query in itertools.combinations(scans, 2)],
    )
    text = f"The shipped recordings, scanned with the shipped detector:\n\n{first}\nDates matched:\n\n{second}"
    sys.stdout.write(text)
    if options.row == ROW and options.model == SHIPPED and not options.augment:
        write_text("shipped.md", text)


def scanned(visit: Path, detector: OnnxDetector) -> Scanned:
    recording = open_recording(visit / "row.mp4")
    begun_s = time.process_time()
    survey = scan(recording, detector)
    part = max(survey.parts, key=lambda part: len(part.trajectory))
    took_s = (time.process_time() - begun_s) / len(recording)
    fruits = FruitCloud.read(visit / "fruits.csv")
    return Scanned(visit.name, part, len(survey.parts), true_boxes(visit), fruits, took_s)


def true_boxes(visit: Path) -> dict[int, TrueBoxes]:
    rows: dict[int, list[tuple[list[float], str, bool]]] = defaultdict(list)
    with (visit / "boxes.csv").open(encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            box_px = [float(line[name]) for name in ("xmin", "ymin", "xmax", "ymax")]
            wanted = float(line["visible"]) > MIN_VISIBLE and box_px[2] - box_px[0] >= MIN_WIDTH_PX
            rows[int(line["frame"])].append((box_px, line["id"], wanted))
    return {
        frame: TrueBoxes(np.array(boxes, float), tuple(names), np.array(wanted, bool))
        for frame, (boxes, names, wanted) in ((frame, zip(*each, strict=True)) for frame, each in rows.items())
    }


def fruit_row(found: Scanned) -> tuple[str, ...]:
    ids, cloud = found.true_ids(), found.part.cloud
    countable = found.countable
    judged = np.array([row for row, name in enumerate(ids) if name], int)
    row_of = {name: row for row, name in enumerate(found.fruits.ids or ())}
    true = [row_of[ids[row]] for row in judged]
    off_mm = 1000 * rigid_residuals(cloud.positions[judged], found.fruits.positions[true])
    wrong_m = cloud.diameters_m[judged] - found.fruits.diameters_m[true]
    sigmas_m = np.array(cloud.extras["diameter_sigma_m"], float)[judged]
    copies = Counter(ids[row] for row in judged)
    split = sum(n - 1 for n in copies.values())
    hidden = len(copies.keys() - countable)
    return (
        found.date if found.n_parts == 1 else f"{found.date}, {found.n_parts} parts",
        str(len(countable)),
        str(len(cloud)),
        f"{len(cloud) / len(countable) - 1:+.1%}",
        _of(len(countable - copies.keys()), countable),
        _of(split, countable),
        _of(hidden, countable),
        _of(len(cloud) - len(judged), countable),
        f"{mota(found):.2f}",
        *(f"{value:.1f}" for value in (np.median(off_mm), np.percentile(off_mm, 95))),
        f"{1000 * np.median(wrong_m):+.1f}",
        f"{np.mean(np.abs(wrong_m) < NINETY * sigmas_m):.2f}",
        f"{1000 * found.cpu_s:.0f}",
    )


def _of(n: int, countable: set[str]) -> str:
    return f"{n} ({n / len(countable):.1%})"


def mota(found: Scanned) -> float:
    """MOTA over the fruits that count: misses, false boxes and switches against their boxes."""
    shown, countable = found.shown(), found.countable
    boxes = found.part.boxes
    names: list[tuple[str, ...]] = []
    numbers: list[NDArray[np.int64]] = []
    for frame, there in found.true.items():
        rows = np.flatnonzero((boxes.frames == frame) & (boxes.fruits >= 0))
        held = {shown[row]: int(boxes.fruits[row]) for row in rows if shown[row]}
        wanted = [name for name, must in zip(there.names, there.wanted, strict=True) if must and name in countable]
        false = [int(boxes.fruits[row]) for row in rows if not shown[row]]
        names.append((*wanted, *[""] * len(false)))
        numbers.append(np.array([*(held.get(name, -1) for name in wanted), *false], np.int64))
    return mot_scores(names, numbers)["mota"]


def match_row(query: Scanned, map: Scanned) -> tuple[str, ...]:
    answer = match(query.part.cloud, map.part.cloud)
    query_ids, map_ids = query.true_ids(), map.true_ids()
    right = [query_ids[q] for q, m in answer.pairs.tolist() if query_ids[q] and query_ids[q] == map_ids[m]]
    common = query.countable & map.countable
    return (
        query.date,
        map.date,
        str(answer.status),
        str(len(answer.pairs)),
        share(len(right) / max(len(answer.pairs), 1)),
        str(len(common)),
        share(len(common.intersection(right)) / len(common)),
    )
