"""The order in which fruits are reckoned: by what was measured, so that it is the same whoever was seen first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.growth.measured import MeasuredFruits

__all__ = ["reckoned_order"]

_OF_A_STRETCH = 25
"""Fruits that are reckoned as those of one tree where no trees are known: as few as say how many of them stopped."""


def reckoned_order(fruits: MeasuredFruits) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows of N fruits in that order, (N,), and the tree of each as a number from 0, ascending, (N,).

    Trees one after another, by the first of their fruits; fruits of a tree by their sizes on the first visit, on the
    second and so on. Ids and names of trees depend on the order in which visits were added to the map, and with the
    order of sums and of random numbers the last digits would. Where no trees are known, stretches of the row stand for
    them: what stops fruits stops those that hang together.
    """
    # Fruits of the same sizes, if any, by their place.
    by_size = np.lexsort([fruits.trees.along_m, *np.nan_to_num(fruits.diameters_mm).T[::-1]])
    ranks = np.empty(len(by_size), np.int64)
    ranks[by_size] = np.arange(len(by_size))
    trees = fruits.trees.numbers if any(fruits.trees.names) else _stretches(fruits.trees.along_m)
    first = np.full(trees.max(initial=-1) + 1, len(ranks))
    np.minimum.at(first, trees, ranks)
    of_fruits = first[trees]
    rows = np.lexsort((ranks, of_fruits))
    return rows, np.unique(of_fruits[rows], return_inverse=True)[1].astype(np.int64)


def _stretches(along_m: NDArray[np.float64]) -> NDArray[np.int64]:
    """Cut N fruits along a row into stretches of as many each; the same from either end."""
    n = len(along_m)
    places = np.argsort(np.argsort(along_m, kind="stable")) + 0.5
    return np.asarray(places * max(n // _OF_A_STRETCH, 1) / max(n, 1), np.int64)
