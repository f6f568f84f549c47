"""The rendered row as trackers get it: boxes without names, exact or stereo depth, true, measured or wrong poses."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.recordings import true_boxes
from benchmarks.tracking_scores import Names, Numbers
from pomona.detect import Detections
from pomona.errors import PomonaError
from pomona.odometry import StereoOdometry
from pomona.recording import Calibration, Frame, open_recording
from pomona.stereo import StereoDepth
from pomona.survey.depth import Lifted, lift
from pomona.survey.tracking import Tracker

RATE_HZ = 10.0

Poses = dict[int, NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class SeenFrame:
    """A frame with its true boxes and their names; `lifted` measures depth at any boxes."""

    number: int
    session_from_camera: NDArray[np.float64]
    boxes_px: NDArray[np.float64]
    names: tuple[str, ...]
    lifted: Callable[[NDArray[np.float64]], Lifted]


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


UNDISTURBED = Disturbance()


def frames_of(source: Path, *, stereo: bool) -> tuple[Calibration, list[SeenFrame]]:
    """Read a date once; depth is the exact picture's, or what stereo measures at the boxes."""
    recording = open_recording(source)
    of_frame = defaultdict(list)
    for box in true_boxes(source):
        of_frame[box.frame].append(box)
    frames = [
        SeenFrame(
            number=frame.number,
            session_from_camera=frame.session_from_camera,
            boxes_px=np.array([box.box_px for box in of_frame[frame.number]], np.float64).reshape(-1, 4),
            names=tuple(box.fruit for box in of_frame[frame.number]),
            lifted=(_by_stereo if stereo else _by_picture)(frame, recording.calibration),
        )
        for frame in recording.frames()
    ]
    return recording.calibration, frames


def _by_picture(frame: Frame, calibration: Calibration) -> Callable[[NDArray[np.float64]], Lifted]:
    depth_m = frame.read_depth()
    return lambda boxes_px: lift(depth_m, boxes_px, calibration)


def _by_stereo(frame: Frame, calibration: Calibration) -> Callable[[NDArray[np.float64]], Lifted]:
    left, right, measure = frame.read_left(), frame.read_right(), StereoDepth(calibration)
    return lambda boxes_px: lift(measure(left, right, boxes_px), boxes_px, calibration)


def poses_by_odometry(source: Path) -> Poses:
    """Follow the camera by its stereo pictures, frame by frame as a scan does."""
    recording = open_recording(source)
    odometry, poses = StereoOdometry(recording.calibration), {}
    for frame in recording.frames():
        grey = (cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) for picture in (frame.read_left(), frame.read_right()))
        motion = odometry(*grey)
        if motion.part > 0 or motion.session_from_camera is None:
            raise PomonaError(f"{source}: odometry broke at frame {frame.number}: {motion.broken}")
        poses[frame.number] = motion.session_from_camera
    return poses


def there_and_back(frames: list[SeenFrame]) -> list[SeenFrame]:
    """Append the frames in reverse, with numbers of their own."""
    last = frames[-1].number
    return frames + [replace(frame, number=last + 1 + k) for k, frame in enumerate(reversed(frames))]


def shaken(frames: list[SeenFrame], place_m: float, turn_rad: float, seed: int) -> Poses:
    """Give poses whose every step is wrong by normal noise along and about each axis, so that they drift."""
    rng = np.random.default_rng(seed)
    pose, poses = frames[0].session_from_camera, {}
    before = pose
    for frame in frames:
        step = np.linalg.inv(before) @ frame.session_from_camera
        wrong = np.eye(4)
        if poses:
            wrong[:3, :3] = Rotation.from_rotvec(turn_rad * rng.normal(size=3)).as_matrix()
            wrong[:3, 3] = place_m * rng.normal(size=3)
        pose, before = pose @ step @ wrong, frame.session_from_camera
        poses[frame.number] = pose
    return poses


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
        boxes_px[:, :2] = np.minimum(boxes_px[:, :2], boxes_px[:, 2:] - 1.0)
        names = (*(frame.names[row] for row in kept), *[""] * strays)
        yield frame, Detections(boxes_px, np.ones(len(names))), names


def tracked(
    frames: list[SeenFrame],
    calibration: Calibration,
    how: Disturbance = UNDISTURBED,
    seed: int = 0,
    poses: Poses | None = None,
) -> tuple[Names, Numbers, Numbers]:
    """Names of the boxes, their tracks as told at once, and in the end (all tracks, of however few boxes)."""
    tracker = Tracker(calibration)
    names, at_once, row_of = [], [], {}
    for frame, detections, of_boxes in disturbed(frames, calibration, how, seed):
        pose = frame.session_from_camera if poses is None else poses[frame.number]
        at_once.append(tracker.update(frame.number, pose, detections, frame.lifted(detections.boxes_px)))
        row_of[frame.number] = len(names)
        names.append(of_boxes)
    tracks = tracker.finish(min_views=1)
    in_the_end = [np.full(len(frame), -1, np.int64) for frame in names]
    for number, row, fruit in zip(tracks.frames.tolist(), tracks.rows.tolist(), tracks.fruits.tolist(), strict=True):
        in_the_end[row_of[number]][row] = fruit
    return names, at_once, in_the_end
