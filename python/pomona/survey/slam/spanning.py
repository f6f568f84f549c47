"""Poses to begin with: along the surest motions, from the first frame of each group that hangs together.

A motion that is wrong altogether may claim to be the surest. Where other motions lead from its one frame to its other,
they are witnesses; one that most of them contradict is taken last.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pomona.step_covariance import carried_covariance
from pomona.survey.refinement import Motions
from pomona.survey.slam.consistency import BELIEVED2, squared_distances

__all__ = ["spanned_poses"]

Array = NDArray[np.float64]


def spanned_poses(motions: Motions, n_frames: int) -> tuple[NDArray[np.int64], Array]:
    """Lay out all frames (Prim's spanning tree of least variance, those that are outvoted last).

    Returns
    -------
    groups : (F,) int64
        Numbers from 0 in the order of their first frames; frames of one number hang together.
    poses : (F, 4, 4) float64
        In the frame of the first camera of the group.
    """
    ways = _ways(motions)
    last = _outvoted(ways, len(motions))
    groups, poses = np.full(n_frames, -1, np.int64), np.tile(np.eye(4), (n_frames, 1, 1))
    n_groups = count = 0
    for root in range(n_frames):
        if groups[root] >= 0:
            continue
        waiting = [(False, 0.0, 0, root, np.eye(4))]
        while waiting:
            _, _, _, row, pose = heapq.heappop(waiting)
            if groups[row] >= 0:
                continue
            groups[row], poses[row] = n_groups, pose
            for way in ways[row]:
                if groups[way.other] < 0:
                    count += 1
                    cost = (bool(last[way.motion]), float(np.trace(way.spread)))
                    heapq.heappush(waiting, (*cost, count, way.other, pose @ way.step))
        n_groups += 1
    return groups, poses


class _Way(NamedTuple):
    """A motion as it leads from one frame to another."""

    motion: int
    other: int
    step: Array
    spread: Array
    """Covariance of the step, in the frame of the other."""


def _ways(motions: Motions) -> dict[int, list[_Way]]:
    ways: dict[int, list[_Way]] = defaultdict(list)
    spreads: Array = np.asarray(np.linalg.inv(motions.information), np.float64)
    rows = zip(motions.first.tolist(), motions.second.tolist(), motions.first_from_second, spreads, strict=True)
    for motion, (first, second, step, spread) in enumerate(rows):
        ways[first].append(_Way(motion, second, step, spread))
        ways[second].append(_Way(motion, first, _inverse(step), carried_covariance(step, spread)))
    return ways


def _outvoted(ways: dict[int, list[_Way]], n_motions: int) -> NDArray[np.bool_]:
    """Say which motions most of their witnesses contradict: other motions between the same frames, and two in a row."""
    seen = [(way, witness) for first in list(ways) for way in ways[first] for witness in _witnesses(ways, first, way)]
    if not seen:
        return np.zeros(n_motions, bool)
    told, others = (np.array([pair[i].step for pair in seen]) for i in (0, 1))
    spreads = np.array([way.spread + witness.spread for way, witness in seen])
    votes = np.where(squared_distances(told, others, spreads) <= BELIEVED2, 1, -1)
    return np.bincount([way.motion for way, _ in seen], votes, n_motions) < 0


def _witnesses(ways: dict[int, list[_Way]], first: int, way: _Way) -> Iterator[_Way]:
    """Give what leads from the first frame to where a motion does without it."""
    for begin in ways[first]:
        if begin.motion == way.motion:
            continue
        if begin.other == way.other:
            yield begin
            continue
        for end in ways[begin.other]:
            if end.other == way.other and end.motion != way.motion:
                spread = carried_covariance(_inverse(end.step), begin.spread) + end.spread
                yield _Way(end.motion, end.other, begin.step @ end.step, spread)


def _inverse(pose: Array) -> Array:
    return np.asarray(np.linalg.inv(pose), np.float64)
