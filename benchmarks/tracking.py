"""Tracking on the rendered row: both dates, true boxes whose names the tracker does not see, disturbed and not.

Writes tracking.csv, tracking_curve.csv, tracking.md and tracking.png. ByteTrack is run where its packages are installed
(dependency group `bench`); else its rows are kept as they were.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from benchmarks.peers import bytetrack
from benchmarks.results import FOLDER, markdown, read_rows, shared_data, write_rows, write_text
from benchmarks.tracking_picture import draw
from benchmarks.tracking_runs import RATE_HZ, Disturbance, SeenFrame, disturbed, frames_of, lifted, tracked
from benchmarks.tracking_scores import Names, Numbers, count, mot_scores, often
from pomona.recording import Calibration
from pomona.tracking import Tracker

DATES = ("2024-08-09", "2024-08-28")
DEPTHS = ("exact", "stereo")
MISSING = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
KINDS = {"boxes missing": Disturbance(), "and 10 % false, 1 px": Disturbance(false=0.1, jitter_px=1.0)}

PAPER = """\
The paper's own tracker, as published (Matos et al., CVPR Workshops 2024; true boxes, four other videos of 110-250
frames with 204-373 apples): count errors 12.9, 0.84, 4.6 and 1.1 %, MOTA .76, .70, .61 and .94. ByteTrack's counts on
those err by 4 to 114 %.
"""


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks tracking", description=__doc__)
    parser.add_argument("--seeds", type=int, default=10, help="runs of each disturbance")
    seeds = parser.parse_args(arguments).seeds
    data = shared_data()
    if data is None:
        sys.stderr.write("tracking: skipped, no folder of recordings (set POMONA_DATA)\n")
        return
    rows, curve, shown = [], [], None
    for date in DATES:
        for depth in DEPTHS:
            calibration, frames = frames_of(data / "rendered_row" / date, stereo=depth == "stereo")
            names, at_once, in_the_end = tracked(frames, calibration)
            rows += [
                scores(date, depth, "at once", names, at_once),
                scores(date, depth, "in the end", names, in_the_end),
            ]
            shown = shown or (names, in_the_end)
            curve += curve_rows(date, depth, calibration, frames, seeds)
            speed(date, depth, calibration, frames)
        rows += peer_rows(date, frames, names)
    write_rows("tracking.csv", rows)
    write_rows("tracking_curve.csv", curve)
    draw(*shown, curve, FOLDER / "tracking.png")
    text = report(rows, curve, seeds)
    write_text("tracking.md", text)
    sys.stdout.write(text)


def scores(date: str, depth: str, tracker: str, names: Names, numbers: Numbers) -> dict[str, object]:
    counted = count(names, numbers)
    every = mot_scores(names, numbers)
    frequent = mot_scores(*often(names, numbers))
    return {
        "date": date,
        "depth": depth,
        "tracker": tracker,
        "fruits": counted.true,
        "reported": counted.reported,
        "error": counted.error,
        "split": counted.split,
        **every,
        "all_fruits": len({name for frame in names for name in frame}),
        "all_tracks": len({int(number) for told in numbers for number in told if number >= 0}),
        **{f"{name}_often": value for name, value in frequent.items()},
    }


def peer_rows(date: str, frames: list[SeenFrame], names: Names) -> list[dict[str, object]]:
    """ByteTrack on the same boxes, or what an earlier run of it gave."""
    if not bytetrack.is_installed():
        kept = [row for row in read_rows("tracking.csv") if row["tracker"] == "ByteTrack" and row["date"] == date]
        return [{name: _number(value) for name, value in row.items()} for row in kept]
    from pomona.detect import Detections

    numbers = bytetrack.follow((Detections(frame.boxes_px, np.ones(len(frame.names))) for frame in frames), RATE_HZ)
    return [scores(date, "none", "ByteTrack", names, numbers)]


def _number(value: str) -> object:
    try:
        return float(value) if "." in value or "e" in value else int(value)
    except ValueError:
        return value


def curve_rows(
    date: str, depth: str, calibration: Calibration, frames: list[SeenFrame], seeds: int
) -> list[dict[str, object]]:
    """Count errors over the part of the boxes that is missing: against fruits that five of the boxes left show."""
    rows = []
    for kind, other in KINDS.items():
        for missing in MISSING:
            how = Disturbance(missing, other.false, other.jitter_px)
            # Without a random choice one run says it all.
            runs = seeds if how != Disturbance() else 1
            found = [count(*pair) for seed in range(runs) for pair in [tracked(frames, calibration, how, seed)[::2]]]
            errors = np.array([one.error for one in found])
            rows.append(
                {
                    "date": date,
                    "depth": depth,
                    "kind": kind,
                    "missing": missing,
                    "runs": runs,
                    "fruits": float(np.mean([one.true for one in found])),
                    "mean_error": float(errors.mean()),
                    "mean_abs_error": float(np.abs(errors).mean()),
                    "least_error": float(errors.min()),
                    "largest_error": float(errors.max()),
                    "split": float(np.mean([one.split / one.true for one in found])),
                    "false": float(np.mean([one.false for one in found])),
                }
            )
            sys.stderr.write(f"{date} {depth}: {kind}, {missing:.0%} missing\n")
    return rows


def speed(date: str, depth: str, calibration: Calibration, frames: list[SeenFrame]) -> None:
    """Say on stderr what a frame takes; not kept, for it is another machine's tomorrow."""
    tracker, spent = Tracker(calibration), []
    for frame, detections, _ in disturbed(frames, calibration, Disturbance(), 0):
        fruits = lifted(frame, detections, calibration)
        start = time.perf_counter()
        tracker.update(frame.number, frame.session_from_camera, detections, fruits)
        spent.append(1000 * (time.perf_counter() - start))
    sys.stderr.write(f"{date} {depth}: {np.median(spent):.2f} ms a frame, at most {max(spent):.2f}\n")


def report(rows: list[dict[str, object]], curve: list[dict[str, object]], seeds: int) -> str:
    def line(row: dict[str, object], of: str) -> list[str]:
        return [*(f"{row[f'{name}{of}']:.3f}" for name in ("mota", "hota", "idf1")), str(row[f"switches{of}"])]

    main_table = markdown(
        ("date, depth, told", "fruits", "reported", "error %", "split", "MOTA", "HOTA", "IDF1", "switches"),
        [
            (
                label(row),
                str(row["fruits"]),
                str(row["reported"]),
                f"{100 * row['error']:+.1f}",
                str(row["split"]),
                *line(row, "_often"),
            )
            for row in rows
        ],
    )
    all_table = markdown(
        ("date, depth, told", "fruits", "tracks", "MOTA", "HOTA", "IDF1", "switches"),
        [(label(row), str(row["all_fruits"]), str(row["all_tracks"]), *line(row, "")) for row in rows],
    )
    curve_table = markdown(
        ("count error %, mean of absolute (largest)", *(f"{missing:.0%}" for missing in MISSING)),
        [
            (f"{date}, {depth}, {kind}", *(curve_cell(curve, date, depth, kind, missing) for missing in MISSING))
            for date in DATES
            for depth in DEPTHS
            for kind in KINDS
        ],
    )
    return (
        "Fruits with boxes in at least 5 frames against tracks with at least 5 boxes; all other boxes are left out:\n\n"
        f"{main_table}\nEvery fruit, every box, every track:\n\n{all_table}\n"
        f"{PAPER}\nBoxes missing at random, and then also 10 % false ones and 1 px on each edge; {seeds} seeds.\n"
        f"Counted are fruits with boxes in at least 5 frames among those that are left:\n\n{curve_table}\n"
        "Poses are the true ones. ByteTrack knows neither poses nor depth; between two frames a fruit moves by two of\n"
        "its diameters.\n"
    )


def label(row: dict[str, object]) -> str:
    return ", ".join(str(row[name]) for name in ("date", "depth", "tracker"))


def curve_cell(curve: list[dict[str, object]], date: str, depth: str, kind: str, missing: float) -> str:
    of = {"date": date, "depth": depth, "kind": kind, "missing": missing}
    row = next(row for row in curve if all(row[name] == value for name, value in of.items()))
    largest = max(row["largest_error"], row["least_error"], key=abs)
    return f"{100 * row['mean_abs_error']:.1f} ({100 * largest:+.1f})"
