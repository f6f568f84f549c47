"""What odometry says at the end: refined poses, and what was measured between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["OdometryTrajectory"]

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
