"""Parts of a recording that see the same fruits, brought into one frame of reference.

Where the camera jumped, or showed nothing for a moment, odometry begins a new part: the pictures before and after have
too little in common. The fruits have more: those at the end of one part and at the begin of the next are the same, seen
from elsewhere. Where their places fit each other along the camera's way, both parts are tracked as one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.survey.part import OpenPart
from pomona.survey.registration import registered

__all__ = ["rejoined"]

Array = NDArray[np.float64]

AT_THE_END = 8
"""Frames at the end of a part, and at the begin of the next, whose fruits are compared: what both see is in there."""

MOVING = 5
"""Steps before the end of a part that say where the camera was going."""


def rejoined(parts: Sequence[tuple[OpenPart, Array]]) -> list[tuple[OpenPart, Array]]:
    """Join the parts that see the same fruits.

    Parameters
    ----------
    parts : sequence of (OpenPart, (F, 4, 4))
        In order of time, each with its poses.

    Returns
    -------
    list of (OpenPart, (F, 4, 4))
        Fewer where some were joined; a joined part has the frame of reference of its first one.
    """
    joined: list[tuple[OpenPart, Array]] = []
    for part, poses in parts:
        relation = _relation(*joined[-1], part, poses) if joined else None
        if relation is None:
            joined.append((part, poses))
            continue
        (before, known), moved = joined[-1], np.asarray(relation @ poses)
        joined[-1] = before.continued(known, part, moved), np.concatenate([known, moved])
    return joined


def _relation(before: OpenPart, known: Array, part: OpenPart, poses: Array) -> Array | None:
    """Give `before_from_part`, None where the fruits do not tell it."""
    if min(len(known), len(poses)) < 2:
        return None
    steps = min(MOVING, len(known) - 1)
    moved = np.linalg.inv(known[-1 - steps]) @ known[-1]
    return registered(
        before.fruits_seen_in(slice(-AT_THE_END, None), known),
        part.fruits_seen_in(slice(AT_THE_END), poses),
        known[-1],
        moved[:3, 3],
        poses[0],
    )
