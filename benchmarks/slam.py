"""Where the camera went, by the constellations of the fruits alone: no corners, no model of motion.

True boxes without their names, depth from the stereo pictures. Both dates of the rendered row and the three of the
shipped one, whole; and there and back, the frames of the way back being those that the way there left out. And a row
that the fast renderer draws here, once around it: its loops join what is seen from opposite sides. Writes slam.csv,
slam.md and docs/images/slam.png.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.results import markdown, shared_data, write_rows, write_text
from benchmarks.slam_picture import write_picture
from pomona.cloud import FruitCloud
from pomona.detect.opening import open_detector
from pomona.localize.following import cloud_of
from pomona.recording import Recording, open_recording
from pomona.recording.poses import read_tum
from pomona.render.filming import Filming, film
from pomona.survey.seeing import Seeing
from pomona.survey.slam import FruitSlam, FruitWay
from pomona.trajectory_scores import Span, TimedPoses, TrajectoryScore, score_trajectory

RENDERED = ("2024-08-09", "2024-08-28")
SHIPPED = ("2024-08-09", "2024-08-28", "2024-09-12")
ROW = Path(__file__).parents[1] / "examples" / "row"

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "slam.png"
DRAWN_SEED = 3
"""Of the row that is drawn: five spindles as they come."""

SHOWN = (
    *((f"rendered row, {date}", "whole") for date in RENDERED),
    *((f"shipped row, {date}", "there and back") for date in SHIPPED[:1]),
    ("drawn row", "around"),
)

MEDIAN_CHI2 = 5.35
"""Of squared errors by true covariances, six degrees."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Walk:
    """What each frame saw, and the true poses."""

    name: str
    clouds: list[FruitCloud]
    poses: Array
    orders: dict[str, list[int]]
    """Which frames are taken, one after the other, by what that is called."""


@dataclass(frozen=True, eq=False)
class Found:
    """What came of a walk."""

    name: str
    variant: str
    way: FruitWay
    score: TrajectoryScore
    honest: float
    worst_mm: float
    n_fruits: float
    at_once_mm: float
    ms_a_frame: float
    longest_ms: float


def main(arguments: list[str]) -> None:
    argparse.ArgumentParser(prog="python -m benchmarks slam", description=__doc__).parse_args(arguments)
    results = []
    for walk in walks():
        for variant, order in walk.orders.items():
            sys.stderr.write(f"slam: {walk.name}, {variant}\n")
            results.append(found(walk, variant, order))
    rows = [row_of(one) for one in results]
    write_rows("slam.csv", rows)
    text = report(rows)
    write_text("slam.md", text)
    sys.stdout.write(text)
    write_picture(PICTURE, [one for one in results if (one.name, one.variant) in SHOWN])


def walks() -> Iterator[Walk]:
    data = shared_data("slam: rendered rows")
    for date in RENDERED if data is not None else ():
        recording = open_recording(data / "rendered_row" / date)
        yield seen(
            f"rendered row, {date}", recording, None, np.array([f.session_from_camera for f in recording.frames()])
        )
    for date in SHIPPED:
        recording = open_recording(ROW / date / "row.mp4", calibration=ROW / date / "calibration.json")
        yield seen(
            f"shipped row, {date}", recording, ROW / date / "boxes.csv", read_tum(ROW / date / "poses_tum.txt")[1]
        )
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "around"
        sys.stderr.write("slam: drawing a row\n")
        film(Filming(path="around", seed=DRAWN_SEED), folder)
        recording = open_recording(folder)
        poses = np.array([frame.session_from_camera for frame in recording.frames()])
        around = seen("drawn row", recording, folder / "boxes.csv", poses)
    yield replace(around, orders={"around": around.orders["whole"]})


def seen(name: str, recording: Recording, boxes: Path | None, poses: Array) -> Walk:
    sys.stderr.write(f"slam: {name}, looking\n")
    seeing = Seeing(recording, open_detector(boxes, None, recording), depth="stereo", colour=False)
    clouds = [cloud_of(seeing(frame).lifted) for frame in recording.frames()]
    there = list(range(len(clouds)))
    return Walk(name, clouds, poses, {"whole": there, "there and back": [*there[::2], *reversed(there[1::2])]})


def found(walk: Walk, variant: str, order: list[int]) -> Found:
    """Find the way; figures are those of its longest part."""
    slam = FruitSlam(threads=1)
    off_m, took_s = [], []
    for here, row in enumerate(order):
        began_s = time.process_time()
        placed = slam.add(walk.clouds[row])
        took_s.append(time.process_time() - began_s)
        true = walk.poses[order][: here + 1][slam.parts == placed.part]
        off_m.append(np.linalg.norm((np.linalg.inv(true[0]) @ true[-1] - placed.session_from_camera)[:3, 3]))
    way = slam.way()
    rows = np.flatnonzero(way.parts == np.bincount(way.parts).argmax())
    poses, true = way.session_from_camera[rows], walk.poses[order][rows]
    of = (TimedPoses(Path(name), one, None) for name, one in (("found", poses), ("true", true)))
    score = score_trajectory(*of, spans=(Span(1, "f"), Span(1.0, "m"), Span(len(rows) - 1, "f")))
    seen_fruits = float(np.mean([len(walk.clouds[row]) for row in order]))
    honest = honesty(poses, true, way.covariances[rows])
    worst = worst_mm(way, walk.poses[order])
    at_once = 1000 * np.array([np.median(off_m), np.mean(took_s), max(took_s)])
    return Found(walk.name, variant, way, score, honest, worst, seen_fruits, *at_once.tolist())


def honesty(poses: Array, true: Array, covariances: Array) -> float:
    """Median squared error of the poses, seen from the first, by their covariances, over that of true ones."""
    left = np.linalg.inv(np.linalg.inv(poses[0]) @ poses) @ np.linalg.inv(true[0]) @ true
    errors = np.concatenate([left[:, :3, 3], Rotation.from_matrix(left[:, :3, :3]).as_rotvec()], axis=1)
    squared = [
        error @ np.linalg.solve(spread, error) for error, spread in zip(errors[1:], covariances[1:], strict=True)
    ]
    return float(np.median(squared) / MEDIAN_CHI2)


def worst_mm(way: FruitWay, true: Array) -> float:
    """Of all links and loops that are believed: the largest error in place, for a false one is off by far."""
    found = [*way.links, *way.loops]
    left = [np.linalg.inv(np.linalg.inv(true[one.first]) @ true[one.second]) @ one.first_from_second for one in found]
    return float(max((1000 * np.linalg.norm(pose[:3, 3]) for pose in left), default=0.0))


def row_of(one: Found) -> dict[str, object]:
    frame, metre, end = (dict(errors.figures()) for _, errors in one.score.relative)
    absolute = one.score.absolute.figures()
    return {
        "recording": one.name,
        "variant": one.variant,
        "frames": len(one.way),
        "fruits_a_frame": one.n_fruits,
        "followed": len(one.score.true),
        "parts": len(np.unique(one.way.parts)),
        "links": len(one.way.links),
        "refused_links": one.way.refused,
        "loops": len(one.way.loops),
        "refused_loops": one.way.refused_loops,
        "worst_mm": one.worst_mm,
        "length_m": one.score.length_m,
        **figures("rms", absolute, "rmse"),
        **figures("frame", frame, "rmse"),
        **figures("metre", metre, "rmse"),
        **figures("end", end, "max"),
        "honest": one.honest,
        "at_once_mm": one.at_once_mm,
        "ms_a_frame": one.ms_a_frame,
        "longest_ms": one.longest_ms,
    }


def figures(name: str, of: dict[str, dict[str, float] | None], figure: str) -> dict[str, float | None]:
    place, turn = of["translation_m"], of["rotation_deg"]
    return {
        f"{name}_mm": None if place is None else 1000 * place[figure],
        f"{name}_deg": None if turn is None else turn[figure],
    }


def report(rows: list[dict[str, object]]) -> str:
    def both(row: dict[str, object], name: str) -> str:
        mm, deg = row[f"{name}_mm"], row[f"{name}_deg"]
        return "-" if mm is None else f"{mm:.1f} mm, {deg:.2f}°"

    table = markdown(
        (
            "recording",
            "fruits",
            "followed",
            "parts",
            "links",
            "loops",
            "worst",
            "way",
            "rms",
            "a frame",
            "a metre",
            "end",
            "honest",
            "at once",
            "ms a frame",
            "longest",
        ),
        [
            (
                f"{row['recording']}, {row['variant']}",
                f"{row['fruits_a_frame']:.0f}",
                f"{row['followed']} of {row['frames']}",
                str(row["parts"]),
                str(row["links"]),
                str(row["loops"]),
                f"{row['worst_mm']:.0f} mm",
                f"{row['length_m']:.1f} m",
                *(both(row, name) for name in ("rms", "frame", "metre", "end")),
                f"{row['honest']:.1f}",
                f"{row['at_once_mm']:.0f} mm",
                f"{row['ms_a_frame']:.0f}",
                f"{row['longest_ms']:.0f}",
            )
            for row in rows
        ],
    )
    return f"The constellations of the fruits alone.\n\n{table}\n{NOTES}\n"


NOTES = """Fruits: of a frame, mean. Followed: frames of the longest part, of which the rest of the row tells. Worst:
the link or loop that is farthest off. Rms: of all poses after the rigid motion that fits positions and orientations
best. A frame, a metre: error of the motion over each, rms. End: of the last pose seen from the first. Honest: median
squared error of the poses by their covariances, over that of true ones: 1 is honest, less is careful. At once: how far
off a frame was when it came, in the median, seen from the first frame of its part. Milliseconds of CPU on one
thread, of a frame as it comes, and of the one that took longest, mostly to close a loop."""
