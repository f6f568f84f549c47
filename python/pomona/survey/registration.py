"""Where one part of a drive lies beside another one, by the fruits that both saw: face of the core's `rejoining.rs`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona import _core

__all__ = ["Fruits", "registered"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fruits:
    """Places (N, 3) with covariances (N, 3, 3), metres."""

    places: Array
    covariances: Array


def registered(before: Fruits, part: Fruits, last: Array, step: Array, first: Array) -> Array | None:
    """Find `before_from_part`, None where the fruits do not tell it.

    Parameters
    ----------
    before, part : Fruits
        Those near the end of one part, and near the begin of the next, in their frames of reference.
    last, first : (4, 4)
        Poses of the last camera of the one and the first camera of the other.
    step : (3,)
        Last motion of the camera, in its own frame.
    """
    return _core.rejoin(
        (before.places, before.covariances),
        (part.places, part.covariances),
        last=last,
        step=step.tolist(),
        first=first,
    )
