"""Which tree each fruit hangs on: as the map names it, else as the fruits tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.plot.projections import side_and_plan
from pomona.tree_rows.names import tree_names

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

    Named by the column ``tree`` where the map has one, a blank cell for the fruits of no tree; else those that the
    fruits themselves tell, see `pomona.tree_rows`.
    """
    axis = side_and_plan(cloud.positions)[0].axes[0]
    along_m = cloud.positions @ axis
    of_fruits = np.array(cloud.extras.get("tree") or tree_names(cloud.positions), dtype=object)
    names = sorted(set(of_fruits.tolist()) - {""}, key=lambda name: along_m[of_fruits == name].mean())
    names += [""] * ("" in of_fruits)
    number_of = {name: number for number, name in enumerate(names)}
    return BearingTrees(tuple(names), np.array([number_of[name] for name in of_fruits], np.int64), along_m)
