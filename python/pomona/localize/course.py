"""Where the camera was in each frame of a recording."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from pomona.cloud import FruitCloud
from pomona.localize.localizer import Localization
from pomona.trajectory import Trajectory

__all__ = ["Step", "Way"]


@dataclass(frozen=True, eq=False)
class Step:
    """One frame.

    Attributes
    ----------
    frame : int
        Its number.
    time_s : float
        Its time, or its number where nothing is timed.
    cloud : FruitCloud
        Fruits that it shows in 3D, in the camera's frame.
    found : Localization
        Where the camera was.
    """

    frame: int
    time_s: float
    cloud: FruitCloud
    found: Localization

    @property
    def n_fruits(self) -> int:
        """Fruits that it shows in 3D."""
        return len(self.cloud)


@dataclass(frozen=True, eq=False, repr=False)
class Way:
    """All frames of a recording.

    Attributes
    ----------
    steps : tuple of Step
        The frames that could be used, in order of time.
    skipped : dict
        Number of each frame that could not be used, and why.
    """

    steps: tuple[Step, ...]
    skipped: dict[int, str]

    def __repr__(self) -> str:
        return f"Way({len(self.found)} of {len(self.steps) + len(self.skipped)} frames found)"

    @property
    def found(self) -> tuple[Step, ...]:
        """The frames whose pose was found."""
        return tuple(step for step in self.steps if step.found)

    @property
    def statuses(self) -> Counter[str]:
        """How often each verdict was given."""
        return Counter(str(step.found.status) for step in self.steps)

    @property
    def trajectory(self) -> Trajectory:
        """`map_from_camera` of the frames that were found; the map is its session."""
        poses = [step.found.map_from_camera for step in self.found]
        return Trajectory(
            frames=np.array([step.frame for step in self.found], np.int64),
            times_s=np.array([step.time_s for step in self.found], np.float64),
            session_from_camera=np.array(poses, np.float64).reshape(-1, 4, 4),
        )
