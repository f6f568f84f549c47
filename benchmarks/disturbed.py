"""The rendered row as worse detectors and cameras see it: counts and the match of both dates, by odometry alone.

Each row of the table disturbs both dates, several times with different seeds where chance has a part. Counted against
the fruits with clear boxes in five frames of the whole undisturbed recording, whatever is left of them. Writes
disturbed.csv and disturbed.md.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.disturbed_boxes import (
    Boxed,
    Boxes,
    Change,
    disturbed_boxes,
    flickering,
    misaligned,
    one_eye,
    rendered,
    rolling,
    stepped,
    write_recording,
)
from benchmarks.lifting import rigid_residuals
from benchmarks.recordings import DATES, detector, rendered_truth, true_boxes
from benchmarks.results import markdown, shared_data, write_rows, write_text
from pomona import match
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.recording import open_recording
from pomona.survey import Part, Survey, scan

MIN_VIEWS = 5
"""Clear boxes of a fruit that is counted."""

UNDISTURBED = Boxed()

Frames = Callable[[Sequence[int]], Sequence[int]]


@dataclass(frozen=True)
class Case:
    """One way to make a recording worse.

    Attributes
    ----------
    name : str
    frames : callable
        Which frames are left.
    boxes : Boxed
        How the detector errs.
    change : callable
        Gives the change of the pictures for a seed; None where they stay.
    seeds : bool
        Whether chance has a part.
    """

    name: str
    frames: Frames = lambda frames: frames
    boxes: Boxed = UNDISTURBED
    change: Callable[[int], Change] | None = None
    seeds: bool = False


CASES = (
    Case("clean"),
    Case("every 2nd frame", frames=lambda frames: frames[::2]),
    Case("every 4th frame", frames=lambda frames: frames[::4]),
    Case("20 % of boxes missing", boxes=Boxed(missing=0.2), seeds=True),
    Case("40 % missing in bursts of four", boxes=Boxed(missing=0.4, burst=4), seeds=True),
    Case("10 % false boxes that last ten frames", boxes=Boxed(false=0.1), seeds=True),
    Case("20 % missing, 1.5 px, 10 % false of six frames",
         boxes=Boxed(missing=0.2, jitter_px=1.5, false=0.1, lasting=6), seeds=True),
    Case("exposure +-0.5 stop", change=lambda seed: flickering(0.5, seed), seeds=True),
    Case("exposure +-1 stop", change=lambda seed: flickering(1.0, seed), seeds=True),
    Case("bands of +-25 % that roll down", change=lambda _: rolling(0.25)),
    Case("one step x 0.6", change=lambda _: stepped(0.6, 20)),
    Case("one eye x 0.7", change=lambda _: one_eye(0.7)),
    Case("one eye x 0.4", change=lambda _: one_eye(0.4)),
    Case("four frames dropped", frames=lambda frames: [*frames[:18], *frames[22:]]),
    Case("right picture 2 px lower", change=lambda _: misaligned(2.0, 0.0)),
    Case("right picture 3 px lower", change=lambda _: misaligned(3.0, 0.0)),
    Case("right picture turned by 0.5 degrees", change=lambda _: misaligned(0.0, 0.5)),
)  # fmt: skip


@dataclass(frozen=True)
class Scanned:
    """One disturbed date, scanned."""

    survey: Survey
    part: Part
    boxes: Boxes
    told: int

    @property
    def true_ids(self) -> list[str]:
        """The true fruit that most boxes of each reported one show, "" where most show none."""
        true_of = {(box.frame, box.box_px): box.fruit for box in self.boxes}
        votes: list[Counter[str]] = [Counter() for _ in range(len(self.part.cloud))]
        boxes = self.part.boxes
        for frame, box_px, fruit in zip(boxes.frames, boxes.boxes_px, boxes.fruits, strict=True):
            if fruit >= 0:
                votes[fruit][true_of[int(frame), tuple(map(float, box_px))]] += 1
        return [vote.most_common(1)[0][0] if vote else "" for vote in votes]


class Date:
    """A rendered date and its truth."""

    def __init__(self, source: Path) -> None:
        self.source, self.recording = source, rendered(source)
        self.truth: FruitCloud = rendered_truth(source)
        self.boxes = list(true_boxes(source))
        clear = Counter(box.fruit for box in self.boxes)
        self.countable = {fruit for fruit, n in clear.items() if n >= MIN_VIEWS}

    def scanned(self, case: Case, seed: int, scratch: Path) -> Scanned | None:
        """Scan it in this case; None where the scan is refused."""
        boxes = disturbed_boxes(self.boxes, case.boxes, self.recording, seed)
        frames = case.frames(self.recording.numbers)
        change = None if case.change is None else case.change(seed)
        write_recording(self.source, scratch, frames, boxes, change)
        recording = open_recording(scratch)
        exact = [type(box)(box.frame, box.fruit, tuple(map(float, box.box_px)), box.visible) for box in boxes]
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            try:
                survey = scan(recording, detector(scratch, recording), odometry=True)
            except PomonaError as error:
                sys.stderr.write(f"disturbed: {case.name}: {error}\n")
                return None
        part = max(survey.parts, key=lambda part: len(part.trajectory))
        return Scanned(survey, part, exact, len(told))


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks disturbed", description=__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="runs of each disturbance that chance has a part in")
    parser.add_argument("--cases", nargs="*", default=[], help="only cases whose names hold one of these; not written")
    options = parser.parse_args(arguments)
    data = shared_data("disturbed")
    if data is None:
        return
    dates = [Date(data / "rendered_row" / date) for date in DATES]
    chosen = [case for case in CASES if not options.cases or any(part in case.name for part in options.cases)]
    rows = [row for case in chosen for row in rows_of(case, dates, options.seeds)]
    text = report(rows)
    sys.stdout.write(text)
    if not options.cases:
        write_rows("disturbed.csv", rows)
        write_text("disturbed.md", text)


def rows_of(case: Case, dates: Sequence[Date], seeds: int) -> list[dict[str, object]]:
    rows = []
    for seed in range(seeds if case.seeds else 1):
        with tempfile.TemporaryDirectory() as scratch:
            began = time.process_time()
            scans = [
                date.scanned(case, 100 * seed + number, Path(scratch) / str(number))
                for number, date in enumerate(dates)
            ]
            seconds = time.process_time() - began
        row: dict[str, object] = {"case": case.name, "seed": seed}
        for number, (date, found) in enumerate(zip(dates, scans, strict=True), start=1):
            row |= {f"{key}_{number}": value for key, value in date_row(date, found).items()}
        row |= match_row(dates, scans) | allowed_row(case, dates, seed) | {"cpu_s": seconds}
        sys.stderr.write(
            " ".join(f"{value:.3g}" if isinstance(value, float) else str(value) for value in row.values()) + "\n"
        )
        rows.append(row)
    return rows


def date_row(date: Date, found: Scanned | None) -> dict[str, object]:
    """Parts, count and kinds of errors of the longest part."""
    true = len(date.countable)
    if found is None:
        return {
            "parts": 0,
            "count_error": -1.0,
            "missed": true,
            "false": 0,
            "split": 0,
            "p95_mm": float("nan"),
            "told": 1,
        }
    ids = found.true_ids
    copies = Counter(name for name in ids if name)
    row_of = {name: row for row, name in enumerate(date.truth.ids or ())}
    judged = [row for row, name in enumerate(ids) if name]
    residuals_mm = np.array([float("nan")])
    if len(judged) > 3:
        true_places = date.truth.positions[[row_of[ids[row]] for row in judged]]
        residuals_mm = 1000 * rigid_residuals(found.part.cloud.positions[judged], true_places)
    return {
        "parts": len(found.survey.parts),
        "count_error": len(ids) / true - 1.0,
        "missed": len(date.countable - copies.keys()),
        "false": ids.count(""),
        "split": sum(n - 1 for n in copies.values()),
        "p95_mm": float(np.percentile(residuals_mm, 95)),
        "told": found.told,
    }


def match_row(dates: Sequence[Date], scans: Sequence[Scanned | None]) -> dict[str, object]:
    map_scan, query_scan = scans
    if map_scan is None or query_scan is None or not len(map_scan.part.cloud) or not len(query_scan.part.cloud):
        return {"status": "-", "precision": None, "recall": 0.0}
    answer = match(query_scan.part.cloud, map_scan.part.cloud)
    query_ids, map_ids = query_scan.true_ids, map_scan.true_ids
    pairs = [(query_ids[q], map_ids[m]) for q, m in answer.pairs.tolist()]
    right = [q for q, m in pairs if q and q == m]
    common = dates[0].countable & dates[1].countable
    precision = len(right) / len(pairs) if pairs else None
    return {"status": answer.status, "precision": precision, "recall": len(set(right) & common) / len(common)}


def allowed_row(case: Case, dates: Sequence[Date], seed: int) -> dict[str, object]:
    """Say what the boxes that are left allow: true names, and the number of boxes that gives the best count."""
    left = []
    for number, date in enumerate(dates):
        frames = set(case.frames(date.recording.numbers))
        boxes = disturbed_boxes(date.boxes, case.boxes, date.recording, 100 * seed + number)
        left.append(Counter(box.fruit for box in boxes if box.fruit and box.frame in frames))

    def counted(least: int) -> list[set[str]]:
        return [{fruit for fruit, n in views.items() if n >= least} for views in left]

    def errors(least: int) -> list[float]:
        return [len(found) / len(date.countable) - 1 for found, date in zip(counted(least), dates, strict=True)]

    best = min(range(1, MIN_VIEWS + 1), key=lambda least: sum(map(abs, errors(least))))
    common = dates[0].countable & dates[1].countable
    recall = len(common.intersection(*counted(best))) / len(common)
    return {"allowed_1": errors(best)[0], "allowed_2": errors(best)[1], "allowed_recall": recall}


def report(rows: list[dict[str, object]]) -> str:
    by_case: dict[str, list[dict[str, object]]] = {}
    for row in rows:
        by_case.setdefault(str(row["case"]), []).append(row)
    table = markdown(
        ("disturbed", "parts", "count error", "missed", "false", "split", "95 % mm", "told", "P", "R", "allowed"),
        [(name, *_cells(of)) for name, of in by_case.items()],
    )
    return (
        "Both dates of the rendered row, stereo pictures and boxes alone, made worse; first date / second date, the\n"
        "mean over the seeds, of the longest part. Counted against fruits with clear boxes in five frames of the\n"
        "whole undisturbed recording. P and R are of the match of both dates, the least R over the seeds in\n"
        "brackets. Allowed: count error and R where it is known which boxes show one fruit, and a fruit counts from\n"
        "the number of boxes on that gives the best count; pictures, which show more, are not looked at.\n\n"
        f"{table}"
    )


def _cells(rows: list[dict[str, object]]) -> tuple[str, ...]:
    def mean(key: str, form: str) -> str:
        values = [[float(str(row[f"{key}_{date}"])) for row in rows] for date in (1, 2)]
        return " / ".join(format(float(np.mean(of)), form) for of in values)

    precisions = [float(str(row["precision"])) for row in rows if row["precision"] is not None]
    recalls = [float(str(row["recall"])) for row in rows]
    return (
        mean("parts", ".3g"), mean("count_error", "+.1%"), mean("missed", ".3g"), mean("false", ".3g"),
        mean("split", ".3g"), mean("p95_mm", ".0f"), mean("told", ".2g"),
        f"{np.mean(precisions):.3f}" if precisions else "-", f"{np.mean(recalls):.3f} ({min(recalls):.3f})",
        f"{mean('allowed', '+.1%')}, {np.mean([float(str(row['allowed_recall'])) for row in rows]):.3f}",
    )  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
