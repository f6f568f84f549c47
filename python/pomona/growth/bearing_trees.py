"""Which tree each fruit hangs on: as the map names it, else the nearest of the trees that stand out in the row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.plot.projections import side_and_plan
from pomona.plot.trees import Trees

__all__ = ["BearingTrees", "bearing_trees"]


@dataclass(frozen=True, eq=False)
class BearingTrees:
    """The trees of N fruits.

    Attributes
    ----------
    names : tuple of T str
        In the order along the row; a single blank one where no trees are known.
    numbers : (N,) int64
        Of each fruit, a row of `names`.
    along_m : (N,) float64
        Place of each fruit along the row.
    """

    names: tuple[str, ...]
    numbers: NDArray[np.int64]
    along_m: NDArray[np.float64]

    def select(self, fruits: NDArray[np.int64]) -> BearingTrees:
        """Keep some fruits, and the trees that they hang on."""
        kept, numbers = np.unique(self.numbers[fruits], return_inverse=True)
        names = tuple(self.names[number] for number in kept)
        return BearingTrees(names, numbers.astype(np.int64), self.along_m[fruits])

    def of_fruits(self) -> tuple[str, ...]:
        """Name of the tree of each fruit."""
        return tuple(self.names[number] for number in self.numbers.tolist())


def bearing_trees(cloud: FruitCloud) -> BearingTrees:
    """Tell the trees of a map's fruits.

    Named by the column ``tree`` where the map has one, a blank cell for the fruits of no tree; else numbered from 1
    along the row where the fruits stand in heaps, see `Trees`.
    """
    axis = side_and_plan(cloud.positions)[0].axes[0]
    along_m = cloud.positions @ axis
    trees = Trees.along(axis, cloud, cloud.positions)
    if trees.names is not None:
        rest = ("",) if "" in cloud.extras["tree"] else ()
        names = (*trees.names, *rest)
        number_of = {name: number for number, name in enumerate(names)}
        return BearingTrees(names, np.array([number_of[name] for name in cloud.extras["tree"]], np.int64), along_m)
    if len(trees.places) < 2:
        return BearingTrees(("",), np.zeros(len(cloud), np.int64), along_m)
    middles = (trees.places[1:] + trees.places[:-1]) / 2.0
    names = tuple(str(number + 1) for number in range(len(trees.places)))
    return BearingTrees(names, np.searchsorted(middles, along_m).astype(np.int64), along_m)
