"""The rendered row as trackers get it: boxes without names, exact or stereo depth, disturbed on request."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.recordings import true_boxes
from benchmarks.tracking_scores import Names, Numbers
from pomona.depth import Lifted, lift
from pomona.detect import Detections
from pomona.recording import Calibration, Frame, open_recording
from pomona.stereo import StereoDepth
from pomona.tracking import Tracker

RATE_HZ = 10.0


@dataclass(frozen=True, eq=False)
class SeenFrame:
    """A frame with its true boxes and their names, and the depth around all of them."""

    number: int
    session_from_camera: NDArray[np.float64]
    boxes_px: NDArray[np.float64]
    names: tuple[str, ...]
    depth_m: NDArray[np.float32]
    disparity_sigma_px: float | None


@dataclass(frozen=True)
class Disturbance:
    """What happens to boxes.

    Attributes
    ----------
    missing : float
        Probability that a box is missing.
    false : float
        Boxes that show no fruit, as a part of the true ones.
    jitter_px : float
        Standard deviation of each edge.
    """

    missing: float = 0.0
    false: float = 0.0
    jitter_px: float = 0.0


def frames_of(source: Path, *, stereo: bool) -> tuple[Calibration, list[SeenFrame]]:
    """Read a date once: depth is the exact picture, or what stereo measures all over the picture."""
    recording = open_recording(source)
    of_frame = defaultdict(list)
    for box in true_boxes(source):
        of_frame[box.frame].append(box)
    measure = StereoDepth(recording.calibration) if stereo else None
    frames = []
    for frame in recording.frames():
        depth_m, sigma_px = _depth(frame, recording.calibration, measure)
        boxes = of_frame[frame.number]
        frames.append(
            SeenFrame(
                number=frame.number,
                session_from_camera=frame.session_from_camera,
                boxes_px=np.array([box.box_px for box in boxes], np.float64).reshape(-1, 4),
                names=tuple(box.fruit for box in boxes),
                depth_m=depth_m,
                disparity_sigma_px=sigma_px,
            )
        )
    return recording.calibration, frames


def _depth(
    frame: Frame, calibration: Calibration, measure: StereoDepth | None
) -> tuple[NDArray[np.float32], float | None]:
    if measure is None:
        return frame.read_depth(), None
    whole = np.array([[0.0, 0.0, calibration.width, calibration.height]])
    found = measure(frame.read_left(), frame.read_right(), whole)
    return found.depth_m, float(found.disparity_sigma_px[0])


def disturbed(
    frames: list[SeenFrame], calibration: Calibration, how: Disturbance, seed: int
) -> Iterator[tuple[SeenFrame, Detections, tuple[str, ...]]]:
    """Give each frame with the boxes that are left, and the name of each: "" for one that shows no fruit."""
    rng = np.random.default_rng(seed)
    size = np.array([calibration.width, calibration.height, calibration.width, calibration.height], np.float64)
    for frame in frames:
        kept = np.flatnonzero(rng.random(len(frame.names)) >= how.missing)
        boxes_px = frame.boxes_px[kept] + how.jitter_px * rng.normal(size=(len(kept), 4))
        strays = rng.binomial(len(frame.names), how.false)
        # As large as fruits here, anywhere in the picture.
        sides = rng.choice(frame.boxes_px[:, 2:] - frame.boxes_px[:, :2], strays) if strays else np.empty((0, 2))
        corners = rng.random((strays, 2)) * (size[:2] - sides)
        boxes_px = np.clip(np.vstack([boxes_px, np.hstack([corners, corners + sides])]), 0.0, size)
        boxes_px[:, 2:] = np.maximum(boxes_px[:, 2:], boxes_px[:, :2] + 1.0)
        names = (*(frame.names[row] for row in kept), *[""] * strays)
        yield frame, Detections(boxes_px, np.ones(len(names))), names


def lifted(frame: SeenFrame, detections: Detections, calibration: Calibration) -> Lifted:
    return lift(frame.depth_m, detections.boxes_px, calibration, disparity_sigma_px=frame.disparity_sigma_px)


def tracked(
    frames: list[SeenFrame],
    calibration: Calibration,
    how: Disturbance = Disturbance(),
    seed: int = 0,
    poses: dict[int, NDArray[np.float64]] | None = None,
) -> tuple[Names, Numbers, Numbers]:
    """Names of the boxes, their tracks as told at once, and in the end (all tracks, of however few boxes)."""
    tracker = Tracker(calibration)
    names, at_once, rows = [], [], {}
    for frame, detections, of_boxes in disturbed(frames, calibration, how, seed):
        pose = frame.session_from_camera if poses is None else poses[frame.number]
        at_once.append(tracker.update(frame.number, pose, detections, lifted(frame, detections, calibration)))
        rows[frame.number] = len(names)
        names.append(of_boxes)
    tracks = tracker.finish(min_views=1)
    in_the_end = [np.full(len(frame), -1, np.int64) for frame in names]
    for number, row, fruit in zip(tracks.frames.tolist(), tracks.rows.tolist(), tracks.fruits.tolist(), strict=True):
        in_the_end[rows[number]][row] = fruit
    return names, at_once, in_the_end
