"""Poses to begin with: along the surest motions, from the first frame of each group that hangs together."""

from __future__ import annotations

import heapq
from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from pomona.survey.refinement import Motions

__all__ = ["spanned_poses"]

Array = NDArray[np.float64]


def spanned_poses(motions: Motions, n_frames: int) -> tuple[NDArray[np.int64], Array]:
    """Lay out all frames (Prim's spanning tree of least variance).

    Returns
    -------
    groups : (F,) int64
        Numbers from 0 in the order of their first frames; frames of one number hang together.
    poses : (F, 4, 4) float64
        In the frame of the first camera of the group.
    """
    ways = _ways(motions)
    groups, poses = np.full(n_frames, -1, np.int64), np.tile(np.eye(4), (n_frames, 1, 1))
    n_groups = count = 0
    for root in range(n_frames):
        if groups[root] >= 0:
            continue
        waiting = [(0.0, root, 0, np.eye(4))]
        while waiting:
            _, row, _, pose = heapq.heappop(waiting)
            if groups[row] >= 0:
                continue
            groups[row], poses[row] = n_groups, pose
            for variance, other, step in ways[row]:
                if groups[other] < 0:
                    count += 1
                    heapq.heappush(waiting, (variance, other, count, pose @ step))
        n_groups += 1
    return groups, poses


def _ways(motions: Motions) -> dict[int, list[tuple[float, int, Array]]]:
    ways: dict[int, list[tuple[float, int, Array]]] = defaultdict(list)
    variances = np.trace(np.linalg.inv(motions.information), axis1=1, axis2=2) if len(motions) else np.empty(0)
    rows = zip(motions.first.tolist(), motions.second.tolist(), motions.first_from_second, variances, strict=True)
    for first, second, first_from_second, variance in rows:
        ways[first].append((float(variance), second, first_from_second))
        ways[second].append((float(variance), first, np.linalg.inv(first_from_second)))
    return ways
