"""Numbers of trees along their row, which stay when sessions are added."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["UNNUMBERED", "numbers_along", "same_trees"]

UNNUMBERED = int(np.iinfo(np.int64).min)
"""In place of the number of a tree that has none."""

SAME_WITHIN = 0.4
"""Of the spacing: nearer than this two trees are one."""


def same_trees(places_m: NDArray[np.float64], known_m: NDArray[np.float64], spacing_m: float) -> NDArray[np.int64]:
    """Return which known tree each tree is, (K,), -1 for none; each is at most one's.

    Parameters
    ----------
    places_m : (K,) float64
        Along the row.
    known_m : (P,) float64
        Those that have numbers already.
    spacing_m : float
    """
    same = np.full(len(places_m), -1)
    if not len(known_m):
        return same
    apart = np.abs(places_m[:, None] - known_m)
    for flat in np.argsort(apart, axis=None, kind="stable").tolist():
        tree, known = divmod(flat, len(known_m))
        if apart[tree, known] > SAME_WITHIN * spacing_m:
            break
        if same[tree] < 0 and known not in same:
            same[tree] = known
    return same


def numbers_along(
    places_m: NDArray[np.float64], spacing_m: float, known: NDArray[np.int64] | None = None
) -> NDArray[np.int64]:
    """Return the numbers of trees, (K,): of places in the planting, so that a tree that is missing keeps its number.

    Trees that are known keep theirs. New ones go on from them, also below 1 where the row turns out to begin earlier.

    Parameters
    ----------
    places_m : (K,) float64
        Along the row, ascending.
    spacing_m : float
    known : (K,) int64, optional
        Numbers that trees have, `UNNUMBERED` where they have none.
    """
    steps = np.maximum(np.round(np.diff(places_m) / spacing_m).astype(np.int64), 1)
    order = np.concatenate([[0], np.cumsum(steps)])
    has = np.zeros(len(order), bool) if known is None else known != UNNUMBERED
    if known is None or not has.any():
        return np.asarray(order + 1)
    # The row may have been counted from its other end.
    falls = has.sum() > 1 and np.polyfit(order[has], known[has], 1)[0] < 0
    counted = -order if falls else order
    numbers = counted + int(np.median(known[has] - counted[has]))
    numbers[has] = known[has]
    taken = set(known[has].tolist())
    for tree in np.flatnonzero(~has).tolist():
        while int(numbers[tree]) in taken:
            numbers[tree] = max(taken) + 1
        taken.add(int(numbers[tree]))
    return np.asarray(numbers)
