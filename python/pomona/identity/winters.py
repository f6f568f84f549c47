"""Which visits are of one season: no fruit outlives the winter, whatever hangs where it hung a year later."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["SEASON_DAYS", "seasons_of"]

SEASON_DAYS = 200
"""From bloom to the last harvest, at most: a later day is one of another season."""

WINTER_DAYS = 365 - SEASON_DAYS
"""What that leaves of a year: between two visits that are as far apart, and none between, lies a winter."""

LEAST_WINTER_DAYS = 90
"""Between two visits of what would be longer than a season: somebody came by in the winter, too. Visits that are nearer
all year are to fruits that hang all year."""


def seasons_of(days: NDArray[np.float64]) -> list[slice]:
    """Return the visits of each season, first to last; `days`, (V,), of all visits, ascending."""
    return _parted(days, 0, len(days))


def _parted(days: NDArray[np.float64], first: int, end: int) -> list[slice]:
    """Part visits at the longest time between two of them, and both sides again, while it is a winter."""
    gaps = np.diff(days[first:end])
    at = int(gaps.argmax()) + 1 if len(gaps) else 0
    is_long = len(gaps) and days[end - 1] - days[first] > SEASON_DAYS
    if not len(gaps) or gaps[at - 1] < (LEAST_WINTER_DAYS if is_long else WINTER_DAYS):
        return [slice(first, end)]
    return _parted(days, first, first + at) + _parted(days, first + at, end)
