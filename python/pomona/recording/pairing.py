"""Pictures of two cameras that belong together in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["half_period", "mutually_nearest"]

Times = NDArray[np.float64] | NDArray[np.int64]


def mutually_nearest(left: Times, right: Times, farthest: float) -> NDArray[np.int64]:
    """Rows (left, right) of pictures that are each other's nearest in time and at most `farthest` apart.

    Parameters
    ----------
    left, right : (L,) and (R,)
        Ascending times, in one unit.
    farthest : float
        In the same unit.

    Returns
    -------
    (P, 2) int64
        Ascending in both columns.
    """
    if not (len(left) and len(right)):
        return np.zeros((0, 2), np.int64)
    nearest_right, nearest_left = _nearest(left, right), _nearest(right, left)
    rows = np.arange(len(left))
    kept = (nearest_left[nearest_right] == rows) & (np.abs(right[nearest_right] - left) <= farthest)
    return np.stack([rows[kept], nearest_right[kept]], axis=1)


def half_period(times: Times) -> float:
    """Half the median interval, in the unit of the times; infinite for a single picture."""
    return float(np.median(np.diff(times))) / 2 if len(times) > 1 else np.inf


def _nearest(of: Times, among: Times) -> NDArray[np.int64]:
    after = np.searchsorted(among, of).clip(0, len(among) - 1)
    before = (after - 1).clip(0)
    return np.where(np.abs(among[before] - of) <= np.abs(among[after] - of), before, after)
