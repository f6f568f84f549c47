"""Which tree each fruit hangs on: as the map names it, else as the fruits tell."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.orchard import FruitsInMap
from pomona.orchard.hanging import tell_trees
from pomona.plot.projections import side_and_plan
from pomona.tree_rows.names import tree_names

__all__ = ["BearingTrees", "as_counted", "bearing_trees"]


@dataclass(frozen=True, eq=False)
class BearingTrees:
    """The trees of N fruits.

    Attributes
    ----------
    names : tuple of T str
        Row by row and in the order along it; a single blank one where no trees are known.
    numbers : (N,) int64
        Of each fruit, a row of `names`.
    along_m : (N,) float64
        Place of each fruit along the row.
    rows : tuple of T str
        Name of the row that each tree stands in, blank where the map names none.
    """

    names: tuple[str, ...]
    numbers: NDArray[np.int64]
    along_m: NDArray[np.float64]
    rows: tuple[str, ...]

    def select(self, fruits: NDArray[np.int64]) -> BearingTrees:
        """Keep some fruits, and the trees that they hang on."""
        kept, numbers = np.unique(self.numbers[fruits], return_inverse=True)
        names = tuple(self.names[number] for number in kept)
        rows = tuple(self.rows[number] for number in kept)
        return BearingTrees(names, numbers.astype(np.int64), self.along_m[fruits], rows)

    def of_fruits(self) -> tuple[str, ...]:
        """Name of the tree of each fruit."""
        return tuple(self.names[number] for number in self.numbers.tolist())


def bearing_trees(cloud: FruitCloud) -> BearingTrees:
    """Tell the trees of a map's fruits.

    Named by the column ``tree`` where the map has one, a blank cell for the fruits of no tree; else those that
    `pomona map trees` would find: told by the fruits themselves, see `pomona.tree_rows`, but for what is likelier no
    fruit, which then hangs on no tree.
    """
    axis = side_and_plan(cloud.positions)[0].axes[0]
    along_m = cloud.positions @ axis
    of_fruits = np.array(cloud.extras.get("tree") or _found(cloud), dtype=object)
    row_of = dict(zip(of_fruits.tolist(), cloud.extras.get("row", ("",) * len(cloud)), strict=True)) | {"": ""}
    middles = {name: along_m[of_fruits == name].mean() for name in set(of_fruits.tolist()) - {""}}
    names = sorted(middles, key=lambda name: (as_counted(row_of[name]), middles[name]))
    names += [""] * ("" in of_fruits)
    number_of = {name: number for number, name in enumerate(names)}
    numbers = np.array([number_of[name] for name in of_fruits], np.int64)
    return BearingTrees(tuple(names), numbers, along_m, tuple(row_of[name] for name in names))


def _found(cloud: FruitCloud) -> list[str]:
    """Return the name of the tree of each fruit, (N,), as the fruits tell it."""
    unsaid = ("",) * len(cloud)
    states, chances = (cloud.extras.get(name, unsaid) for name in ("state", "fruit_probability"))
    telling = np.flatnonzero(tell_trees(states, [float(chance) if chance else None for chance in chances]))
    names = [""] * len(cloud)
    parts, ways = (cloud.parts, cloud.ways) if isinstance(cloud, FruitsInMap) else (np.zeros(len(cloud), np.int64), {})
    for fruit, name in zip(telling.tolist(), tree_names(cloud.positions[telling], parts[telling], ways), strict=True):
        names[fruit] = name
    return names


def as_counted(name: str) -> tuple[tuple[int, str], ...]:
    """Return a key by which row 2 comes before row 10."""
    parts = re.split(r"0*([0-9]+)", name)
    # A longer number is a larger one, whatever its length: names come from strangers.
    return tuple((len(part) if number % 2 else 0, part) for number, part in enumerate(parts))
