"""Rotations without a preference."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["uniform_rotation"]


def uniform_rotation(rng: np.random.Generator, *, upright: bool = False) -> NDArray[np.float64]:
    """Draw a rotation, (3, 3), uniform among all, or among those about z where it stays upright.

    A unit quaternion with normal components is a uniform rotation (Marsaglia 1972; Shoemake 1992).
    """
    w, x, y, z = rng.normal(size=4)
    if upright:
        x = y = 0.0
    norm = np.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
