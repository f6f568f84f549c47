"""Tracking on the rendered row: both dates, true boxes whose names the tracker does not see, disturbed and not.

Writes tracking.csv, tracking_curve.csv, tracking_drift.csv, tracking.md and tracking.png. ByteTrack is run where its
packages are installed (dependency group `bench`); else its rows are kept as they were.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from benchmarks.peers import bytetrack
from benchmarks.results import FOLDER, read_rows, shared_data, write_rows, write_text
from benchmarks.tracking_picture import draw
from benchmarks.tracking_report import DATES, DRIFTS, KINDS, MISSING, report
from benchmarks.tracking_runs import (
    RATE_HZ,
    UNDISTURBED,
    Disturbance,
    SeenFrame,
    disturbed,
    frames_of,
    poses_by_odometry,
    shaken,
    there_and_back,
    tracked,
)
from benchmarks.tracking_scores import Count, Names, Numbers, count, mot_scores, often
from pomona.detect import Detections
from pomona.recording import Calibration
from pomona.survey.tracking import Tracker


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks tracking", description=__doc__)
    parser.add_argument("--seeds", type=int, default=5, help="runs of each disturbance")
    seeds = parser.parse_args(arguments).seeds
    data = shared_data("tracking")
    if data is None:
        return
    rows, curve, drift, shown = [], [], [], []
    for date in DATES:
        source = data / "rendered_row" / date
        for depth in ("exact", "stereo"):
            calibration, frames = frames_of(source, stereo=depth == "stereo")
            runs = {"true": tracked(frames, calibration)}
            if depth == "stereo":
                runs["odometry"] = tracked(frames, calibration, poses=poses_by_odometry(source))
                shown.append((f"{date}, stereo depth, odometry", *runs["odometry"][::2]))
            for poses, (names, at_once, in_the_end) in runs.items():
                rows.append(scores(date, depth, poses, "at once", names, at_once))
                rows.append(scores(date, depth, poses, "in the end", names, in_the_end))
            curve += curve_rows(date, depth, calibration, frames, seeds)
            drift += drift_rows(date, depth, calibration, frames, seeds)
            speed(date, depth, calibration, frames)
        rows += peer_rows(date, frames)
    write_rows("tracking.csv", rows)
    write_rows("tracking_curve.csv", curve)
    write_rows("tracking_drift.csv", drift)
    draw(shown, curve, FOLDER / "tracking.png")
    text = report(rows, curve, drift, seeds)
    write_text("tracking.md", text)
    sys.stdout.write(text)


def scores(date: str, depth: str, poses: str, tracker: str, names: Names, numbers: Numbers) -> dict[str, object]:
    counted = count(names, numbers)
    frequent = mot_scores(*often(names, numbers))
    return {
        "date": date,
        "depth": depth,
        "poses": poses,
        "tracker": tracker,
        "fruits": counted.true,
        "reported": counted.reported,
        "error": counted.error,
        "split": counted.split,
        **mot_scores(names, numbers),
        "all_fruits": len({name for frame in names for name in frame}),
        "all_tracks": len({int(number) for told in numbers for number in told if number >= 0}),
        **{f"{name}_often": value for name, value in frequent.items()},
    }


def peer_rows(date: str, frames: list[SeenFrame]) -> list[dict[str, object]]:
    """ByteTrack on the same boxes, or what an earlier run of it gave."""
    if not bytetrack.is_installed():
        kept = [row for row in read_rows("tracking.csv") if row["tracker"] == "ByteTrack" and row["date"] == date]
        return [{name: _number(value) for name, value in row.items()} for row in kept]
    numbers = bytetrack.follow((Detections(frame.boxes_px, np.ones(len(frame.names))) for frame in frames), RATE_HZ)
    return [scores(date, "none", "none", "ByteTrack", [frame.names for frame in frames], numbers)]


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
            runs = [tracked(frames, calibration, how, seed) for seed in range(1 if how == UNDISTURBED else seeds)]
            found = [count(names, in_the_end) for names, _, in_the_end in runs]
            rows.append({"date": date, "depth": depth, "kind": kind, "missing": missing, **summed_up(found)})
            sys.stderr.write(f"{date} {depth}: {kind}, {missing:.0%} missing\n")
    return rows


def drift_rows(
    date: str, depth: str, calibration: Calibration, frames: list[SeenFrame], seeds: int
) -> list[dict[str, object]]:
    """Count errors with poses that drift, along the row and back again."""
    both_ways = there_and_back(frames)
    rows = []
    for step, (place_m, turn_rad) in DRIFTS.items():
        found, ends_m = [], []
        for seed in range(seeds):
            poses = shaken(both_ways, place_m, turn_rad, seed)
            names, _, in_the_end = tracked(both_ways, calibration, poses=poses)
            last = both_ways[-1]
            found.append(count(names, in_the_end))
            ends_m.append(np.linalg.norm(poses[last.number][:3, 3] - last.session_from_camera[:3, 3]))
        rows.append({"date": date, "depth": depth, "step": step, "end_m": float(np.mean(ends_m)), **summed_up(found)})
        sys.stderr.write(f"{date} {depth}: drift of {step} a frame\n")
    return rows


def summed_up(found: list[Count]) -> dict[str, object]:
    errors = np.array([one.error for one in found])
    return {
        "runs": len(found),
        "fruits": float(np.mean([one.true for one in found])),
        "mean_error": float(errors.mean()),
        "mean_abs_error": float(np.abs(errors).mean()),
        "least_error": float(errors.min()),
        "largest_error": float(errors.max()),
        "split": float(np.mean([one.split / one.true for one in found])),
        "false": float(np.mean([one.false for one in found])),
    }


def speed(date: str, depth: str, calibration: Calibration, frames: list[SeenFrame]) -> None:
    """Say on stderr what a frame takes; not kept, for it is another machine's tomorrow."""
    tracker, spent = Tracker(calibration), []
    for frame, detections, _ in disturbed(frames, calibration, UNDISTURBED, 0):
        fruits = frame.lifted(detections.boxes_px)
        start = time.perf_counter()
        tracker.update(frame.number, frame.session_from_camera, detections, fruits)
        spent.append(1000 * (time.perf_counter() - start))
    sys.stderr.write(f"{date} {depth}: {np.median(spent):.2f} ms a frame, at most {max(spent):.2f}\n")
