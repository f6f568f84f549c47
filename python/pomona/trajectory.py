"""Where the camera was, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError

__all__ = ["Trajectory"]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses of the left camera in the session's frame of reference.

    Attributes
    ----------
    frames : (F,) int64
        Frame numbers, the same as in `Views.frames`, each once.
    times_s : (F,) float64
        Time of each frame, seconds.
    session_from_camera : (F, 4, 4) float64
        Rigid transforms; cameras look along z, x right, y down.
    """

    frames: NDArray[np.int64]
    times_s: NDArray[np.float64]
    session_from_camera: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", np.ascontiguousarray(self.frames, np.int64))
        object.__setattr__(self, "times_s", np.ascontiguousarray(self.times_s, np.float64))
        object.__setattr__(self, "session_from_camera", np.ascontiguousarray(self.session_from_camera, np.float64))
        n = len(self.frames)
        shapes = (self.frames.shape, self.times_s.shape, self.session_from_camera.shape)
        if shapes != ((n,), (n,), (n, 4, 4)):
            raise PomonaError(f"trajectory: found shapes {shapes}, expected (F,), (F,) and (F, 4, 4)")
        if len(np.unique(self.frames)) != n:
            raise PomonaError("trajectory: a frame number is used twice, expected each frame once")
        if not (np.isfinite(self.times_s).all() and np.isfinite(self.session_from_camera).all()):
            raise PomonaError("trajectory: a time or pose is NaN or infinite, expected finite numbers")

    def __len__(self) -> int:
        return len(self.frames)
