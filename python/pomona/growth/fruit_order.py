"""The order in which fruits are reckoned: by what was measured, so that it is the same whoever was seen first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.growth.measured import MeasuredFruits

__all__ = ["reckoned_order"]


def reckoned_order(fruits: MeasuredFruits) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows of N fruits in that order, (N,), and the tree of each as a number from 0, ascending, (N,).

    Trees one after another, by the first of their fruits; fruits of a tree by their sizes on the first visit, on the
    second and so on. Ids and names of trees depend on the order in which visits were added to the map, and with the
    order of sums and of random numbers the last digits would.
    """
    # Fruits of the same sizes, if any, by their place.
    by_size = np.lexsort([fruits.trees.along_m, *np.nan_to_num(fruits.diameters_mm).T[::-1]])
    ranks = np.empty(len(by_size), np.int64)
    ranks[by_size] = np.arange(len(by_size))
    first = np.full(len(fruits.trees.names), len(ranks))
    np.minimum.at(first, fruits.trees.numbers, ranks)
    of_fruits = first[fruits.trees.numbers]
    rows = np.lexsort((ranks, of_fruits))
    return rows, np.unique(of_fruits[rows], return_inverse=True)[1].astype(np.int64)
