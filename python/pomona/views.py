"""Which frame saw which fruit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.arrays import checked_array

__all__ = ["Views"]


@dataclass(frozen=True, eq=False)
class Views:
    """Which frame saw which fruit, as pairs.

    Attributes
    ----------
    frames : (V,) int64
        Frame number of each sighting.
    fruits : (V,) int64
        Row of the fruit of each sighting.
    """

    frames: NDArray[np.int64]
    fruits: NDArray[np.int64]

    def __post_init__(self) -> None:
        frames = checked_array("views.frames", self.frames, np.int64, (None,))
        fruits = checked_array("views.fruits", self.fruits, np.int64, (len(frames),))
        object.__setattr__(self, "frames", frames)
        object.__setattr__(self, "fruits", fruits)

    def __len__(self) -> int:
        return len(self.frames)
