"""Which frames a detector looked at, of which a file of boxes tells only where it found something.

A frame without boxes is one in which nothing was found, or one that nobody looked at: a detector at half the rate,
labels of key frames, of the first half. Fruits stay from frame to frame, so the frames beside tell which. They have m
boxes, as Poisson's distribution of rate l has where it has any: m = l / (1 - exp(-l)). A look there finds nothing with
q = exp(-l). The share x of the steps from a frame with boxes to one without a look is the most likely one,

    x = 1 / (N + R) sum_r x / (x + (1 - x) q_r),

over R runs of frames without boxes and N frames with some. Runs that are rather not looked at are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

__all__ = ["looked_at"]

ROUNDS = 200
"""By then rates and the share have settled, or are as good as none."""


def looked_at(numbers: Sequence[int], n_boxes: Mapping[int, int]) -> frozenset[int]:
    """Tell which frames were looked at.

    Parameters
    ----------
    numbers : sequence of int
        Frame numbers in order of time.
    n_boxes : mapping
        Number of boxes of each frame that has any.

    Returns
    -------
    frozenset of int
        Frames with boxes, and those in which rather nothing was found. Of a file without boxes all.
    """
    counts = [n_boxes.get(number, 0) for number in numbers]
    runs = _runs_without_boxes(counts)
    if not runs or not any(counts):
        return frozenset(numbers)
    skipped = _skipped(np.array([_beside(counts, run) for run in runs]), sum(count > 0 for count in counts))
    dark = {row for run, is_skipped in zip(runs, skipped, strict=True) if is_skipped for row in run}
    return frozenset(number for row, number in enumerate(numbers) if row not in dark)


def _runs_without_boxes(counts: Sequence[int]) -> list[list[int]]:
    grouped = groupby(range(len(counts)), key=lambda row: counts[row] > 0)
    return [list(rows) for has_boxes, rows in grouped if not has_boxes]


def _beside(counts: Sequence[int], run: Sequence[int]) -> float:
    """Mean number of boxes in the frames before and after a run."""
    return float(np.mean([counts[row] for row in (run[0] - 1, run[-1] + 1) if 0 <= row < len(counts)]))


def _skipped(beside: NDArray[np.float64], n_with_boxes: int) -> NDArray[np.bool_]:
    rate = beside.copy()
    for _ in range(ROUNDS):
        rate = beside * -np.expm1(-rate)
    by_chance = np.exp(-rate)
    share, odds = 0.5, np.ones(len(beside))
    for _ in range(ROUNDS):
        odds = share / (share + (1 - share) * by_chance)
        share = odds.sum() / (n_with_boxes + len(beside))
    return np.asarray(odds > 0.5)
