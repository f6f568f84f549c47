"""What odometry says of one frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Motion"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """One frame.

    Attributes
    ----------
    session_from_camera : (4, 4) float64 or None
        Pose of the left camera in the frame of reference of its part, the camera of the part's first frame. None where
        the frame could not be placed.
    part : int
        Number of the part, from 0. Nothing is known of the pose of one part in another.
    broken : str or None
        On the first frame of every part but the first: why the part before ended.
    lost : str or None
        Why this frame has no pose.
    inliers : int
        Points that agree with the pose.
    keyframe : bool
        Whether the frame became one of those that are adjusted together.
    """

    session_from_camera: Array | None
    part: int
    broken: str | None = None
    lost: str | None = None
    inliers: int = 0
    keyframe: bool = False
