"""Long recordings and large pictures: frames a second and peak memory of `pomona scan`, in processes of their own.

The rendered row is repeated forwards and backwards to thousands of frames, left and right alone, boxes without names,
poses by odometry: memory must not grow with length, and a fruit that comes back stays one fruit. The same pictures at
1280x720 (enlarged: they cost what large pictures cost, and say nothing about accuracy). Start and end of a scan, which
take as long for a short recording as for a long one, show apart: a rate without them is that of the frames which a run
has more than the shortest one of its size. Writes endurance.csv and endurance.md.
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

RATES = {
    "frames_per_s": "frames/s",
    "cpu_ms_per_frame": "CPU ms a frame",
    "steady_frames_per_s": "steady frames/s",
    "steady_cpu_ms_per_frame": "steady CPU ms",
}
"""Columns of the table and their headings."""

HEADER = ("frame", "xmin", "ymin", "xmax", "ymax", "score")


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks endurance", description=__doc__)
    parser.add_argument("--frames", type=int, nargs="+", default=[40, 1000, 10000], help="lengths at 640x360")
    parser.add_argument("--large", type=int, nargs="+", default=[40, 400], help="lengths at 1280x720")
    options = parser.parse_args(arguments)
    data = shared_data("endurance")
    if data is None:
        return
    source = data / "rendered_row" / DATES[0]
    with tempfile.TemporaryDirectory() as scratch:
        large = enlarged(source, Path(scratch) / "large")
        sizes = (("640x360", source, 1.0, options.frames), ("1280x720", large, 2.0, options.large))
        rows = []
        for size, pictures, scale, lengths in sizes:
            folders = [repeated(source, pictures, Path(scratch) / f"{size}_{n}", n, scale) for n in sorted(lengths)]
            # The first run compiles Python's modules, which an installation has done.
            measured(folders[0], size, Path(scratch))
            rows += without_start([measured(folder, size, Path(scratch)) for folder in folders])
    write_rows("endurance.csv", rows)
    text = report(rows)
    write_text("endurance.md", text)
    sys.stdout.write(text)


def repeated(source: Path, pictures: Path, folder: Path, length: int, scale: float) -> Path:
    """Walk the row forwards and backwards until there are so many frames; pictures are links, boxes are scaled."""
    once = len(list((pictures / "left").iterdir()))
    there_and_back = [*range(once), *range(once - 2, 0, -1)]
    order = [there_and_back[k % len(there_and_back)] for k in range(length)]
    for kind in ("left", "right"):
        (folder / kind).mkdir(parents=True)
        files = sorted((pictures / kind).iterdir())
        for number, frame in enumerate(order):
            (folder / kind / f"{number:05d}{files[frame].suffix}").symlink_to(files[frame].resolve())
    (folder / "calibration.json").write_bytes((pictures / "calibration.json").read_bytes())
    write_boxes(source, folder, order, scale)
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


def measured(folder: Path, size: str, scratch: Path) -> dict[str, object]:
    """Scan in a process of its own; its peak memory is what the system counted."""
    program = [sys.executable, "-c", "from pomona.cli import main; main()"]
    command = [*program, "scan", str(folder), "-o", str(folder / "fruits.csv"), "--json"]
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(scratch / "bytecode")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    began = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=sys.stderr, env=environment)
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
        "cpu_s": usage.ru_utime + usage.ru_stime,
        "cpu_ms_per_frame": 1000 * (usage.ru_utime + usage.ru_stime) / found["n_frames"],
        "peak_mb": usage.ru_maxrss / 1024,
    }


def without_start(rows: list[dict[str, object]]) -> list[dict[str, object]]:
    """Give the rows of one size, the shortest first, with the rates of the frames that each has more than the first."""
    shortest = rows[0]
    for row in rows:
        frames, seconds, cpu_s = (float(row[name]) - float(shortest[name]) for name in ("frames", "seconds", "cpu_s"))
        row["steady_frames_per_s"] = frames / seconds if frames else None
        row["steady_cpu_ms_per_frame"] = 1000 * cpu_s / frames if frames else None
    return rows


def report(rows: list[dict[str, object]]) -> str:
    table = markdown(
        ("pictures", "frames", "fruits", "parts", *RATES.values(), "peak MB"),
        [
            (
                str(row["size"]),
                str(row["frames"]),
                str(row["fruits"]),
                str(row["parts"]),
                *("" if row[name] is None else f"{row[name]:.0f}" for name in (*RATES, "peak_mb")),
            )
            for row in rows
        ],
    )
    heading = f"`pomona scan` of stereo pictures on {os.cpu_count()} cores, detector excluded:"
    apart = "Steady: of the frames that a run has more than the shortest of its size, so without start and end."
    return f"{heading}\n\n{table}\n{apart}\n"
