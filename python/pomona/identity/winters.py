"""Which visits are of one season: no fruit outlives the winter, whatever hangs where it hung a year later."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

__all__ = ["SEASON_DAYS", "seasons_of"]

SEASON_DAYS = 200
"""From bloom to the last harvest, at most: a later day is one of another season."""

WINTER_DAYS = 365 - SEASON_DAYS
"""What that leaves of a year: between two visits that are as far apart, and none between, lies a winter."""


def seasons_of(days: NDArray[np.float64]) -> list[slice]:
    """Return the visits of each season, first to last; `days`, (V,), of all visits, ascending."""
    begins = [0, *(np.flatnonzero(np.diff(days) >= WINTER_DAYS) + 1).tolist(), len(days)]
    return [slice(first, end) for first, end in pairwise(begins)]
