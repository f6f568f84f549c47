"""What odometry says at the end: refined poses, and what was measured between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.odometry.part import Part

__all__ = ["OdometryTrajectory", "trajectory_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class OdometryTrajectory:
    """All frames that have a pose, refined, and what was measured between them.

    Attributes
    ----------
    frames : (F,) int64
        Which frames, counted from 0 in the order in which they were given.
    parts : (F,) int64
        Part of each.
    session_from_camera : (F, 4, 4) float64
        Poses in the frame of reference of their part.
    first, second : (M,) int64
        Rows of `frames` between which a motion was measured, both of one part; with these motions all frames of a part
        hang together.
    first_from_second : (M, 4, 4) float64
        The measured motions.
    information : (M, 6, 6) float64
        Inverse covariances of a step (translation, rotation), metres and radians, of the second camera in its own
        frame.
    median_disparity_px : float
        Median over the keyframes, NaN where there is none. Lengths err by what disparities are off by together, over
        this.
    """

    frames: NDArray[np.int64]
    parts: NDArray[np.int64]
    session_from_camera: Array
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    first_from_second: Array
    information: Array
    median_disparity_px: float

    def __len__(self) -> int:
        return len(self.frames)


def trajectory_of(parts: Sequence[Part]) -> OdometryTrajectory:
    """Put the parts together, in the order of their frames.

    Keyframes hang on the keyframe before, with the information that the adjustment leaves when all points and other
    poses are free; the frames between hang on the last keyframe before them.
    """
    frames = [(number, frame) for number, part in enumerate(parts) for frame in sorted(part.frames)]
    row_of = {frame: row for row, (_, frame) in enumerate(frames)}
    motions = [motion for part in parts for motion in _motions(part, row_of)]
    first, second, relative, information = zip(*motions, strict=True) if motions else ((), (), (), ())
    return OdometryTrajectory(
        frames=np.array([frame for _, frame in frames], np.int64),
        parts=np.array([number for number, _ in frames], np.int64),
        session_from_camera=np.array([parts[number].pose(frame) for number, frame in frames]).reshape(-1, 4, 4),
        first=np.array(first, np.int64),
        second=np.array(second, np.int64),
        first_from_second=np.array(relative, np.float64).reshape(-1, 4, 4),
        information=np.array(information, np.float64).reshape(-1, 6, 6),
        median_disparity_px=_median([px for part in parts for px in part.window.disparities_px]),
    )


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else float("nan")


def _motions(part: Part, row_of: dict[int, int]) -> list[tuple[int, int, Array, Array]]:
    """First row, second row, motion and information, in the order of the second row."""
    poses, information = part.window.poses, part.window.information
    keyframes = {placed.keyframe: row_of[frame] for frame, placed in part.frames.items() if placed.information is None}
    motions = []
    for frame, placed in sorted(part.frames.items()):
        if placed.information is not None:
            step = (keyframes[placed.keyframe], placed.keyframe_from_camera, placed.information)
        elif placed.keyframe > 0:
            before = placed.keyframe - 1
            step = (keyframes[before], np.linalg.inv(poses[before]) @ poses[placed.keyframe], information[before])
        else:
            continue
        motions.append((step[0], row_of[frame], step[1], step[2]))
    return motions
