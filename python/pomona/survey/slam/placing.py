"""Where a new frame is: what ties it to frames before are witnesses, and those that agree outvote others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pomona.survey.refinement import Motions
from pomona.survey.slam.consistency import BELIEVED2, squared_distances

__all__ = ["Placing", "placings"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


class Placing(NamedTuple):
    """Where a frame is in one of the parts."""

    part: int
    pose: Array


def placings(parts: Rows, poses: Array, ties: Motions) -> list[Placing]:
    """Place a frame in each part that ties it to itself, the surest first.

    In a part it lies where the surest tie has it of those that the most others agree with. Where as many say one thing
    as say another nobody knows which of them lie, and the part has no place for it.

    Parameters
    ----------
    parts, poses
        Of the frames so far.
    ties : Motions
        From these to the new frame.
    """
    found = []
    at = poses[ties.first] @ ties.first_from_second
    spreads: Array = np.asarray(np.linalg.inv(ties.information), np.float64)
    doubts = np.trace(spreads, axis1=1, axis2=2)
    for part in np.unique(parts[ties.first]).tolist():
        rows = np.flatnonzero(parts[ties.first] == part)
        agree = _agreeing(at[rows], spreads[rows])
        votes = agree.sum(axis=1)
        order = np.lexsort((doubts[rows], -votes))
        if not (~agree[order[0]] & (votes == votes[order[0]])).any():
            best = rows[order[0]]
            found.append((float(doubts[best]), Placing(part, at[best])))
    return [placing for _, placing in sorted(found, key=lambda one: one[0])]


def _agreeing(poses: Array, spreads: Array) -> NDArray[np.bool_]:
    """Say which of some poses of one frame lie as far from each other as chance has them, (T, T)."""
    n = len(poses)
    both = (spreads[:, None] + spreads[None]).reshape(-1, 6, 6)
    squared = squared_distances(np.repeat(poses, n, axis=0), np.tile(poses, (n, 1, 1)), both)
    return np.asarray(squared.reshape(n, n) <= BELIEVED2)
