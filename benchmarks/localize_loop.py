"""Does the loop of a robot keep up, and does it last? Boxes given; stereo depth, odometry and localisation together.

The shipped drive of one date in the map of another, on two threads, without what opening takes; then the localiser
alone, driven there and back by the same frames for 100,000 updates, with its memory on the way. Writes
localize_loop.md.
"""

from __future__ import annotations

import argparse
import sys
import time
from itertools import chain, cycle, islice
from pathlib import Path

import numpy as np

from benchmarks.localize import EXAMPLES, SHOWN, Drive, drive
from benchmarks.results import markdown, write_text
from pomona import Localizer
from pomona.detect.opening import open_detector
from pomona.localize.following import localize
from pomona.recording import open_recording

TIMES = 5
"""The drive is followed so often; the median counts."""


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks localize_loop", description=__doc__)
    parser.add_argument("--updates", type=int, default=100_000)
    options = parser.parse_args(arguments)
    map, query = (drive("row", EXAMPLES / date, "true") for date in SHOWN)
    text = f"{_loop(map)}\n{_lasting(map, query, options.updates)}"
    sys.stdout.write(text)
    write_text("localize_loop.md", text)


def _loop(map: Drive) -> str:
    """Follow the other drive as `pomona localize` does."""
    visit = EXAMPLES / SHOWN[1]
    localizer, seconds, n_found, n = Localizer(map.map, threads=2), [], 0, 0
    for _ in range(TIMES):
        recording = open_recording(visit / "row.mp4")
        detector = open_detector(visit / "boxes.csv", None, recording)
        begun_s = time.perf_counter()
        way = localize(recording, detector, localizer)
        seconds.append(time.perf_counter() - begun_s)
        n, n_found = len(way.steps), sum(bool(step.found) for step in way.steps)
    rate = n / float(np.median(seconds))
    return f"The whole loop, boxes given, two threads: {n_found} of {n} frames of 640x360 found, {rate:.0f} frames/s.\n"


def _lasting(map: Drive, query: Drive, updates: int) -> str:
    """Drive there and back by the true motion, and look at the memory after each tenfold of updates."""
    localizer, n = Localizer(map.map, threads=1), len(query.frames)
    there_and_back = cycle(chain(range(n), range(n - 2, 0, -1)))
    looks = [updates // 100, updates // 10, updates]
    rows, before, n_found, begun_s = [], None, 0, time.process_time()
    for number, frame in enumerate(islice(there_and_back, updates), start=1):
        pose = query.map_from_camera[frame]
        n_found += bool(
            localizer.update(query.frames[frame], None if before is None else np.linalg.solve(before, pose))
        )
        before = pose
        if number in looks:
            spent_ms = 1000 * (time.process_time() - begun_s) / number
            rows.append((f"{number:,}", f"{n_found / number:.4f}", f"{spent_ms:.2f}", f"{_resident_mb():.1f}"))
    return markdown(("updates", "found", "CPU ms each", "resident MB"), rows)


def _resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * 4096 / 1e6
