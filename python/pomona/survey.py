"""The story of a scan: recording -> detections -> fruits in 3D, frame by frame -> one cloud of fruits."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud, Views
from pomona.depth import Lifted, Refusal, lift
from pomona.detect import Detections, Detector
from pomona.errors import PomonaError, PomonaWarning
from pomona.fusion import fuse_centres, fuse_diameters
from pomona.recording import Frame, Recording
from pomona.recording.pictures import UnreadablePictureError
from pomona.trajectory import Trajectory

__all__ = ["Survey", "require_depth", "scan"]

Progress = Callable[[int, int, int], None]
"""Called after each frame with frames done, frames in all, sightings so far."""


POSE_FILES = "poses_tum.txt, in a TUM RGB-D folder groundtruth.txt"

PLAUSIBLE_DIAMETER_M = (0.005, 0.4)
"""The smallest berries and the largest melons."""


@dataclass(frozen=True, eq=False)
class Survey:
    """What a scan found.

    Attributes
    ----------
    cloud : FruitCloud
        Every fruit once, in the session's frame: that of the poses, or of the left camera of a single frame. The
        column `diameter_sigma_m` in `extras` is the standard deviation of the diameter, metres.
    trajectory : Trajectory
        Poses of the left camera.
    detections : int
        Boxes seen.
    refused : Counter of Refusal
        Boxes that gave no fruit, by reason.
    skipped : dict
        Number of each frame whose picture could not be read, and why.
    """

    cloud: FruitCloud
    trajectory: Trajectory
    detections: int
    refused: Counter[Refusal]
    skipped: dict[int, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Sightings:
    """Fruits seen in single frames, in the session's frame of reference: struct of lists, filled frame by frame."""

    ids: list[str] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)
    centres: list[NDArray[np.float64]] = field(default_factory=list)
    covariances: list[NDArray[np.float64]] = field(default_factory=list)
    diameters_m: list[float] = field(default_factory=list)
    diameter_sigmas_m: list[float] = field(default_factory=list)
    hidden: list[float] = field(default_factory=list)
    directions: list[NDArray[np.float64]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.ids)

    def add(self, frame: Frame, session_from_camera: NDArray[np.float64], names: list[str], lifted: Lifted) -> None:
        rotation, translation_m = session_from_camera[:3, :3], session_from_camera[:3, 3]
        self.ids.extend(names)
        self.frames.extend([frame.number] * len(lifted))
        self.centres.extend(lifted.centres_in_camera @ rotation.T + translation_m)
        self.covariances.extend(rotation @ lifted.covariances @ rotation.T)
        self.diameters_m.extend(lifted.diameters_m.tolist())
        self.diameter_sigmas_m.extend(lifted.diameter_sigmas_m.tolist())
        self.hidden.extend(lifted.hidden.tolist())
        distances_m = np.linalg.norm(lifted.centres_in_camera, axis=1, keepdims=True)
        self.directions.extend(lifted.centres_in_camera / distances_m @ rotation.T)


def scan(recording: Recording, detector: Detector, *, progress: Progress | None = None) -> Survey:
    """Scan a recording with depth: every box lifted to 3D, boxes of one id fused to one fruit.

    A recording of more than one frame needs poses, and ids in its detections.

    Parameters
    ----------
    recording : Recording
        With depth in every frame.
    detector : Detector
        Gives boxes; their ids are the names of the fruits. Without ids, in a single frame, fruits are named by row.
    progress : callable, optional
        Called after each frame.

    Raises
    ------
    PomonaError
        When depth, poses or ids are missing, or no picture can be read. Single ones that cannot are skipped and told.
    """
    require_depth(recording)
    trajectory = _trajectory(recording)
    sightings, seen, refused = _Sightings(), 0, Counter[Refusal]()
    skipped: dict[int, str] = {}
    for done, frame in enumerate(recording.frames(), start=1):
        detections = detector(frame)
        try:
            lifted = _lift(recording, frame, detections)
        except UnreadablePictureError as error:
            skipped[frame.number] = str(error)
            continue
        sightings.add(frame, trajectory.session_from_camera[done - 1], _names(recording, detections, lifted), lifted)
        seen += len(detections)
        refused += lifted.refused
        if progress is not None:
            progress(done, len(recording), len(sightings))
    _tell_skipped(recording, skipped)
    _check_sizes(recording, sightings)
    return Survey(_fused(sightings), trajectory, seen, refused, skipped)


def require_depth(recording: Recording) -> None:
    """Refuse a recording without depth before anything is decoded.

    Raises
    ------
    PomonaError
        One line.
    """
    pictures = recording.description()["pictures"]
    if "depth" not in pictures:
        found = " and ".join(pictures)
        raise PomonaError(f"{recording.path}: found {found} pictures, expected depth: stereo is not measured yet")


def _tell_skipped(recording: Recording, skipped: dict[int, str]) -> None:
    """Say how many frames could not be read, and the first of them; a scan of nothing is no scan."""
    if not skipped:
        return
    first = next(iter(skipped.values()))
    if len(skipped) == len(recording):
        raise PomonaError(first)
    message = f"{recording.path}: skipped {len(skipped)} of {len(recording)} frames that cannot be read, first {first}"
    warnings.warn(message, PomonaWarning, stacklevel=3)


def _trajectory(recording: Recording) -> Trajectory:
    """Poses of the recording; a single frame without poses is its own frame of reference."""
    if recording.trajectory is not None:
        return recording.trajectory
    if len(recording) > 1:
        raise PomonaError(f"{recording.path}: found {len(recording)} frames without poses, expected {POSE_FILES}")
    return Trajectory(np.array(recording.numbers, np.int64), np.zeros(1), np.eye(4)[None])


def _lift(recording: Recording, frame: Frame, detections: Detections) -> Lifted:
    if frame.read_depth is None:
        raise PomonaError(f"{recording.path}: frame {frame.number} has no depth, expected a picture in depth/")
    return lift(frame.read_depth(), detections.boxes_px, recording.calibration)


def _names(recording: Recording, detections: Detections, lifted: Lifted) -> list[str]:
    if detections.ids is not None:
        return [detections.ids[row] for row in lifted.rows]
    if len(recording) > 1 and len(detections):
        raise PomonaError(
            f"{recording.path}: found boxes without ids in {len(recording)} frames, expected an id for each"
        )
    return [str(row) for row in lifted.rows]


def _check_sizes(recording: Recording, sightings: _Sightings) -> None:
    """Warn when the fruits cannot be fruits: then a unit is wrong, mostly that of the depth pictures."""
    low_m, high_m = PLAUSIBLE_DIAMETER_M
    if len(sightings) and not low_m <= (median_m := float(np.median(sightings.diameters_m))) <= high_m:
        expected = f"{1000 * low_m:g} to {1000 * high_m:g} mm"
        unit = f"depth_unit_m {recording.calibration.depth_unit_m:g}, fx {recording.calibration.fx:g} px"
        message = (
            f"{recording.path}: the median diameter is {1000 * median_m:.3g} mm, expected {expected}: check {unit}"
        )
        warnings.warn(message, PomonaWarning, stacklevel=3)


def _fused(sightings: _Sightings) -> FruitCloud:
    """Fuse the sightings of each id; fruits in the order in which they were first seen.

    A sighting's centre lies behind the surface by half the diameter of that sighting. The fused diameter is better, so
    each centre first moves along its ray by half the difference.
    """
    row_of = {name: row for row, name in enumerate(dict.fromkeys(sightings.ids))}
    fruit = np.array([row_of[name] for name in sightings.ids], np.int64)
    groups = [np.flatnonzero(fruit == row) for row in range(len(row_of))]
    covariances = np.array(sightings.covariances).reshape(-1, 3, 3)
    diameters_m = np.array(sightings.diameters_m, np.float64)
    sigmas_m = np.array(sightings.diameter_sigmas_m, np.float64)
    hidden = np.array(sightings.hidden, np.float64)
    sizes = np.array([fuse_diameters(diameters_m[group], sigmas_m[group], hidden[group]) for group in groups])
    sizes = sizes.reshape(-1, 2)
    deeper_m = (sizes[fruit, 0] - diameters_m) / 2
    centres = np.array(sightings.centres).reshape(-1, 3)
    centres += deeper_m[:, None] * np.array(sightings.directions).reshape(-1, 3)
    places = [fuse_centres(centres[group], covariances[group]) for group in groups]
    return FruitCloud(
        positions=np.array([centre for centre, _ in places]).reshape(-1, 3),
        ids=tuple(row_of),
        diameters_m=sizes[:, 0],
        covariances=np.array([covariance for _, covariance in places]).reshape(-1, 3, 3),
        n_views=np.array([len(group) for group in groups], np.int64),
        views=Views(frames=np.array(sightings.frames, np.int64), fruits=fruit),
        extras={"diameter_sigma_m": tuple(f"{sigma_m:.6f}" for sigma_m in sizes[:, 1])},
    )
