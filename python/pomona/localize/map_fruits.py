"""Which fruits of a map may still hang there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud

__all__ = ["hanging_rows"]

GONE = "gone"
"""State of a fruit that the map thinks is no longer there."""


def hanging_rows(cloud: FruitCloud) -> NDArray[np.int64]:
    """Give the rows of the fruits that are not gone, as far as the cloud says."""
    states = cloud.extras.get("state")
    if states is None:
        return np.arange(len(cloud), dtype=np.int64)
    return np.flatnonzero([state != GONE for state in states]).astype(np.int64)
