"""Points that a detector took for fruits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.planting import unit_vectors

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["false_points"]


def false_points(rng: np.random.Generator, fruits: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Draw (count, 3) points: half of them anywhere in the fruits' box, half beside a fruit."""
    in_box = (count + 1) // 2
    if count == 0:
        return np.empty((0, 3))
    anywhere = rng.uniform(fruits.min(axis=0), fruits.max(axis=0), (in_box, 3))
    beside = fruits[rng.integers(len(fruits), size=count - in_box)]
    offsets = unit_vectors(rng, (len(beside),)) * rng.uniform(0.08, 0.15, (len(beside), 1))
    return np.concatenate([anywhere, beside + offsets])
