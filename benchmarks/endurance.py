"""Long recordings and large pictures: frames a second and peak memory of `pomona scan`, in processes of their own.

The rendered row is repeated forwards and backwards to thousands of frames, left and right alone, boxes without names,
poses by odometry: memory must not grow with length, and a fruit that comes back stays one fruit. The same pictures at
1280x720 (enlarged: they cost what large pictures cost, and say nothing about accuracy). Writes endurance.csv and
endurance.md.
"""

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import cv2

from benchmarks.recordings import DATES, true_boxes
from benchmarks.results import markdown, shared_data, write_rows, write_text

HEADER = ("frame", "xmin", "ymin", "xmax", "ymax", "score")


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks endurance", description=__doc__)
    parser.add_argument("--frames", type=int, nargs="+", default=[40, 1000, 10000], help="lengths")
    options = parser.parse_args(arguments)
    data = shared_data()
    if data is None:
        sys.stderr.write("endurance: skipped, no folder of recordings (set POMONA_DATA)\n")
        return
    source = data / "rendered_row" / DATES[0]
    with tempfile.TemporaryDirectory() as scratch:
        rows = [measured(repeated(source, Path(scratch) / f"{length}", length), "640x360") for length in options.frames]
        rows.append(measured(enlarged(source, Path(scratch) / "large"), "1280x720"))
    write_rows("endurance.csv", rows)
    text = report(rows)
    write_text("endurance.md", text)
    sys.stdout.write(text)


def repeated(source: Path, folder: Path, length: int) -> Path:
    """Walk the row forwards and backwards until there are so many frames; pictures are links."""
    once = len(list((source / "left").iterdir()))
    there_and_back = [*range(once), *range(once - 2, 0, -1)]
    order = [there_and_back[k % len(there_and_back)] for k in range(length)]
    for kind in ("left", "right"):
        (folder / kind).mkdir(parents=True)
        pictures = sorted((source / kind).iterdir())
        for number, frame in enumerate(order):
            (folder / kind / f"{number:05d}{pictures[frame].suffix}").symlink_to(pictures[frame].resolve())
    (folder / "calibration.json").write_bytes((source / "calibration.json").read_bytes())
    write_boxes(source, folder, order, 1.0)
    return folder


def enlarged(source: Path, folder: Path) -> Path:
    for kind in ("left", "right"):
        (folder / kind).mkdir(parents=True)
        for file in sorted((source / kind).iterdir()):
            picture = cv2.resize(cv2.imread(str(file)), None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
            cv2.imwrite(str(folder / kind / file.name), picture)
    fields = json.loads((source / "calibration.json").read_text(encoding="utf-8"))
    doubled = {name: 2 * fields[name] for name in ("width", "height", "fx", "fy", "cx", "cy")}
    (folder / "calibration.json").write_text(json.dumps({**fields, **doubled}), encoding="utf-8")
    write_boxes(source, folder, range(len(list((source / "left").iterdir()))), 2.0)
    return folder


def write_boxes(source: Path, folder: Path, order: Sequence[int], scale: float) -> None:
    boxes: dict[int, list[tuple[float, ...]]] = {}
    for box in true_boxes(source):
        boxes.setdefault(box.frame, []).append(tuple(scale * edge for edge in box.box_px))
    with (folder / "detections.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADER)
        for number, frame in enumerate(order):
            writer.writerows((number, *box_px, 1) for box_px in boxes.get(frame, ()))


def measured(folder: Path, size: str) -> dict[str, object]:
    """Scan in a process of its own; its peak memory is what the system counted."""
    program = [sys.executable, "-c", "from pomona.cli import main; main()"]
    command = [*program, "scan", str(folder), "-o", str(folder / "fruits.csv"), "--json"]
    began = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=sys.stderr)
    printed = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - began
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    found = json.loads(printed)
    return {
        "size": size,
        "frames": found["n_frames"],
        "fruits": found["n_fruits"],
        "parts": len(found["parts"]),
        "seconds": seconds,
        "frames_per_s": found["n_frames"] / seconds,
        "cpu_ms_per_frame": 1000 * (usage.ru_utime + usage.ru_stime) / found["n_frames"],
        "peak_mb": usage.ru_maxrss / 1024,
    }


def report(rows: list[dict[str, object]]) -> str:
    table = markdown(
        ("pictures", "frames", "fruits", "parts", "frames/s", "CPU ms a frame", "peak MB"),
        [
            (
                str(row["size"]),
                str(row["frames"]),
                str(row["fruits"]),
                str(row["parts"]),
                *(f"{row[name]:.0f}" for name in ("frames_per_s", "cpu_ms_per_frame", "peak_mb")),
            )
            for row in rows
        ],
    )
    return f"`pomona scan` of stereo pictures on {os.cpu_count()} cores, detector excluded, start included:\n\n{table}"
