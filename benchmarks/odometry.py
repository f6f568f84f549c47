"""Where the camera went, from stereo pictures alone: the rendered row on both dates, and a drive of KITTI.

Each recording whole, every second frame of it, and with one frame blackened in the middle; the rendered row also
refined with its fruits (true boxes and names, depth from the stereo pictures). Writes odometry.csv, odometry.md and
odometry.png.
"""

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.recordings import true_boxes
from benchmarks.results import FOLDER, markdown, shared_data, write_rows, write_text
from benchmarks.trajectory_errors import Errors, compare
from pomona.odometry import OdometryTrajectory, StereoOdometry
from pomona.recording import Calibration, open_recording
from pomona.stereo import StereoDepth
from pomona.survey.depth import lift
from pomona.survey.refinement import Motions, SeenFruits, refine

RECORDINGS = ("rendered_row/2024-08-09", "rendered_row/2024-08-28", "kitti_stereo")
VARIANTS = ("all frames", "every 2nd", "one black")
WITH_FRUITS = ("all frames", "every 2nd")

SEGMENTS_M = {"rendered_row": (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), "kitti_stereo": (10.0, 20.0, 30.0, 40.0, 50.0)}
"""KITTI's measure takes segments of 100 to 800 m; these drives are 7 and 60 m long."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drive:
    """Grey pictures and true poses, the first pose being the origin."""

    name: str
    calibration: Calibration
    pictures: list[tuple[NDArray[np.uint8], NDArray[np.uint8]]]
    poses: Array


def main(arguments: list[str]) -> None:
    argparse.ArgumentParser(prog="python -m benchmarks odometry", description=__doc__).parse_args(arguments)
    data = shared_data("odometry")
    if data is None:
        return
    cv2.setNumThreads(2)
    rows, found = [], {}
    for name in RECORDINGS:
        drive = read(data, name)
        for variant in VARIANTS:
            sys.stderr.write(f"odometry: {name}, {variant}\n")
            trajectory, row = measured(drive, variant)
            of = longest(trajectory)
            true = drive.poses[:: step(variant)][trajectory.frames[of]]
            rows.append({"recording": name, "variant": variant, **row})
            found[name, variant] = (true, trajectory.session_from_camera[of])
            if name.startswith("rendered_row") and variant in WITH_FRUITS and of.all():
                poses = refined(data / name, trajectory, step(variant))
                errors = compare(poses, true, 1, SEGMENTS_M["rendered_row"])
                rows.append({**rows[-1], "variant": f"{variant}, with fruits", **vars(errors), **NOT_MEASURED})
    write_rows("odometry.csv", rows)
    turns = first_turns(read(data, "kitti_stereo"), *found["kitti_stereo", "all frames"])
    text = report(rows, found, turns)
    write_text("odometry.md", text)
    sys.stdout.write(text)
    draw(found, FOLDER / "odometry.png")


def read(data: Path, name: str) -> Drive:
    recording = open_recording(data / name)
    frames = list(recording.frames())
    pictures = [tuple(cv2.cvtColor(one(), cv2.COLOR_BGR2GRAY) for one in (f.read_left, f.read_right)) for f in frames]
    poses = np.array([frame.session_from_camera for frame in frames])
    return Drive(name, recording.calibration, pictures, np.linalg.inv(poses[0]) @ poses)


NOT_MEASURED = {"keyframes": None, "information_chi2": None, "keyframe_ms": None, "cpu_ms": None, "wall_ms": None}


def step(variant: str) -> int:
    return 2 if variant == "every 2nd" else 1


def longest(trajectory: OdometryTrajectory) -> NDArray[np.bool_]:
    """Frames of the longest part."""
    return trajectory.parts == int(np.bincount(trajectory.parts).argmax())


def measured(drive: Drive, variant: str) -> tuple[OdometryTrajectory, dict[str, object]]:
    """Follow the camera; the row of the table is about the longest part."""
    pictures, true = drive.pictures[:: step(variant)], drive.poses[:: step(variant)]
    if variant == "one black":
        pictures = list(pictures)
        middle = len(pictures) // 2
        pictures[middle] = tuple(np.zeros_like(picture) for picture in pictures[middle])
    odometry = StereoOdometry(drive.calibration)
    wall_s, keyframes, cpu_s = time.perf_counter(), [], []
    for left, right in pictures:
        began_s = time.process_time()
        keyframes.append(odometry(left, right).keyframe)
        cpu_s.append(time.process_time() - began_s)
    wall_s = time.perf_counter() - wall_s
    trajectory = odometry.trajectory()
    of = longest(trajectory)
    parts = int(trajectory.parts.max()) + 1
    segments_m = SEGMENTS_M[drive.name.partition("/")[0]]
    errors = compare(trajectory.session_from_camera[of], true[trajectory.frames[of]], parts, segments_m)
    return trajectory, {
        "frames_given": len(pictures),
        **vars(errors),
        "keyframes": sum(keyframes),
        "information_chi2": consistency(trajectory, true),
        "keyframe_ms": 1000 * float(np.median(np.array(cpu_s)[keyframes])),
        "cpu_ms": 1000 * float(np.mean(cpu_s)),
        "wall_ms": 1000 * wall_s / len(pictures),
    }


def refined(source: Path, trajectory: OdometryTrajectory, every: int) -> Array:
    """Poses after the refinement with fruits in true boxes, their depth from the stereo pictures."""
    recording = open_recording(source)
    stereo = StereoDepth(recording.calibration)
    boxes: dict[int, list[tuple[str, tuple[int, int, int, int]]]] = {}
    for box in true_boxes(source):
        boxes.setdefault(box.frame, []).append((box.fruit, box.box_px))
    frames, names, centres, covariances = [], [], [], []
    row_of = {int(count) * every: row for row, count in enumerate(trajectory.frames)}
    for count, frame in enumerate(recording.frames()):
        if count not in row_of or frame.number not in boxes:
            continue
        boxes_px = np.array([box_px for _, box_px in boxes[frame.number]], np.float64)
        depth = stereo(frame.read_left(), frame.read_right(), boxes_px)
        lifted = lift(depth, boxes_px, recording.calibration)
        frames += [row_of[count]] * len(lifted)
        names += [boxes[frame.number][row][0] for row in lifted.rows]
        centres.append(lifted.centres_in_camera)
        covariances.append(lifted.covariances)
    fruits = np.unique(names, return_inverse=True)[1]
    sightings = SeenFruits(np.array(frames), fruits, np.concatenate(centres), np.concatenate(covariances))
    motions = Motions(trajectory.first, trajectory.second, trajectory.first_from_second, trajectory.information)
    return refine(trajectory.session_from_camera, sightings, motions).session_from_camera


def consistency(trajectory: OdometryTrajectory, true: Array) -> float:
    """Median of e^T I e over the relative motions, over 5.35, its median for true information: 1 is honest."""
    squared = []
    for first, second, found, information in zip(
        trajectory.first, trajectory.second, trajectory.first_from_second, trajectory.information, strict=True
    ):
        one, other = (true[trajectory.frames[row]] for row in (first, second))
        error = np.linalg.inv(np.linalg.inv(one) @ other) @ found
        xi = np.concatenate([error[:3, 3], cv2.Rodrigues(error[:3, :3])[0][:, 0]])
        squared.append(xi @ information @ xi)
    return float(np.median(squared) / 5.35)


def report(rows: list[dict[str, object]], found: dict[tuple[str, str], tuple[Array, Array]], turns: str) -> str:
    table = markdown(
        (
            "recording",
            "frames",
            "placed",
            "parts",
            "end",
            "",
            "rms",
            "",
            "segments",
            "",
            "honest",
            "keyframe",
            "CPU",
            "wall",
        ),
        [
            (
                f"{row['recording']}, {row['variant']}",
                row["frames_given"],
                row["frames"],
                row["parts"],
                f"{100 * row['end_m'] / row['length_m']:.2f} %",
                f"{row['end_deg']:.2f} deg",
                f"{100 * row['rms_m'] / row['length_m']:.2f} %",
                f"{row['rms_deg']:.2f} deg",
                f"{row['segment_percent']:.2f} %",
                f"{row['segment_deg_per_m']:.4f} deg/m",
                "" if row["information_chi2"] is None else f"{row['information_chi2']:.1f}",
                *("" if row[name] is None else f"{row[name]:.0f} ms" for name in ("keyframe_ms", "cpu_ms", "wall_ms")),
            )
            for row in rows
        ],
    )
    settled = later(*found["kitti_stereo", "all frames"])
    return (
        f"Stereo pictures alone, 2 threads.\n\n{table}\n{NOTES}\n\n"
        f"KITTI from frame {EARLY} on: {settled.segment_percent:.2f} %, {settled.segment_deg_per_m:.4f} deg/m.\n"
        f"{turns}\n"
    )


NOTES = """End: error of the last pose seen from the first one, over the distance. Rms: of all poses after the rigid
motion that fits positions and orientations best, over the distance. Segments: as KITTI's measure, mean over all
sub-drives of 1 to 6 m (rendered row) and 10 to 50 m (KITTI, whose own measure begins at 100 m); each ends at the pose
nearest to its length, KITTI's at the first beyond, which shows a twentieth more. Honest: median squared error of
relative motions by their information, over what it is for true information (on KITTI the truth itself is off by more
than that). Keyframe: CPU time of the median keyframe; CPU and wall: mean over all frames. With fruits: the same poses,
refined with the fruits in true boxes with true names, depth from stereo."""


EARLY = 10
"""Frames of the drive whose truth is compared with the left camera alone."""


def turned(rotation: Array) -> str:
    """Say a rotation of the camera as its turn to the right and its roll."""
    _, turn, roll = np.degrees(cv2.Rodrigues(rotation)[0].ravel())
    return f"{turn:+.2f} and {roll:+.2f}"


def first_turns(drive: Drive, true: Array, found: Array) -> str:
    """Turn and roll over the first frames: by the left camera alone (SIFT, essential matrix), odometry and truth."""
    alone = left_alone(drive.pictures[0][0], drive.pictures[EARLY][0], drive.calibration)
    shown = ", ".join(
        f"{turned(rotation)} ({name})"
        for name, rotation in (
            ("left camera alone", alone),
            ("odometry", found[0, :3, :3].T @ found[EARLY, :3, :3]),
            ("truth", true[0, :3, :3].T @ true[EARLY, :3, :3]),
        )
    )
    return f"Turn and roll from frame 0 to {EARLY}, degrees: {shown}."


def left_alone(first: Array, later: Array, calibration: Calibration) -> Array:
    """Rotation of the later camera in the first one, by matched corners of two left pictures."""
    cv2.setRNGSeed(0)
    sift = cv2.SIFT_create()
    (points, words), (later_points, later_words) = (sift.detectAndCompute(one, None) for one in (first, later))
    pairs = [a for a, b in cv2.BFMatcher().knnMatch(words, later_words, k=2) if a.distance < 0.7 * b.distance]
    seen = np.array([points[pair.queryIdx].pt for pair in pairs])
    again = np.array([later_points[pair.trainIdx].pt for pair in pairs])
    intrinsics = np.array([[calibration.fx, 0, calibration.cx], [0, calibration.fy, calibration.cy], [0, 0, 1]])
    essential, kept = cv2.findEssentialMat(seen, again, intrinsics, cv2.RANSAC, 0.9999, 0.5)
    _, later_from_first, _, _ = cv2.recoverPose(essential, seen, again, intrinsics, mask=kept)
    return later_from_first.T


def later(true: Array, found: Array) -> Errors:
    return compare(found[EARLY:], true[EARLY:], 1, SEGMENTS_M["kitti_stereo"][:4])


def draw(found: dict[tuple[str, str], tuple[Array, Array]], path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 9), layout="constrained")
    axes = figure.subplots(len(RECORDINGS), 2, width_ratios=(3, 2))
    for (left, right), name in zip(axes, RECORDINGS, strict=True):
        true, _ = found[name, "all frames"]
        left.plot(true[:, 0, 3], true[:, 2, 3], color="0.6", linewidth=4, label="truth")
        for variant, style in zip(VARIANTS, ("-", "--", ":"), strict=True):
            truth, poses = found[name, variant]
            there = truth[0] @ np.linalg.inv(poses[0]) @ poses
            left.plot(there[:, 0, 3], there[:, 2, 3], style, label=variant)
            error_mm = 1000 * np.linalg.norm(there[:, :3, 3] - truth[:, :3, 3], axis=1)
            way_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1))])
            right.plot(way_m, error_mm, style, label=variant)
        left.set(title=name, xlabel="x of the first camera, m", ylabel="z, m")
        left.set_aspect("equal", adjustable="datalim")
        right.set(xlabel="distance, m", ylabel="error, mm")
        left.legend(fontsize=8)
    FigureCanvasAgg(figure).print_figure(str(path), dpi=90, metadata={"Software": None})
