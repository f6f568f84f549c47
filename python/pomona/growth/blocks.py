"""Whole blocks: the orchard, each row and each tree, how many fruits, how big on average, how fast."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.growth.bearing_trees import as_counted
from pomona.growth.foretelling import Summary
from pomona.growth.measured import MeasuredFruits
from pomona.growth.whole_fruits import whole_fruits

__all__ = ["ALL", "HALF_A_FRUIT", "Block", "block_counts", "block_means", "blocks_of"]

ALL = "all"
"""The block of all fruits."""

HALF_A_FRUIT = 0.5
"""Expected to hang: less is rounded to none."""


@dataclass(frozen=True, eq=False)
class Block:
    """The fruits that are counted together, of a tree, a row, a part, or all: each by its probability that it hangs.

    Attributes
    ----------
    kind : {"all", "part", "row", "tree"}
    name : str
        Of the row or the tree, or the number of the part; blank for all, and for the fruits of no tree.
    chances : (N,) float64
        That it is a fruit, hangs, and is one of these.
    """

    kind: str
    name: str
    chances: NDArray[np.float64]

    @property
    def n_fruits(self) -> int:
        """How many are expected to hang, as a whole number."""
        return whole_fruits(self.chances.sum())

    def mean_of(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean of (N, ...) values over what hangs."""
        return np.asarray(self.chances @ values / self.chances.sum())

    @property
    def title(self) -> str:
        """What to call it: a name that says what it is, as of row 1, says it once."""
        if not self.name:
            return ALL if self.kind == ALL else f"no {self.kind}"
        return self.name if self.name.lower().startswith(self.kind) else f"{self.kind} {self.name}"


def blocks_of(fruits: MeasuredFruits) -> tuple[Block, ...]:
    """All fruits that may hang, of each part and of each row where the map has several, of each tree, then of no tree.

    Rows and trees on which less than half a fruit is expected have none.
    """
    chances, trees = fruits.hang_chances, fruits.trees
    rows = np.array(fruits.cloud.extras.get("row", ("",) * len(chances)))
    names = sorted(set(rows.tolist()) - {""}, key=as_counted)
    parts = np.unique(fruits.parts).tolist()
    groups = [("part", str(part), fruits.parts == part) for part in (parts if len(parts) > 1 else ())]
    groups += [("row", name, rows == name) for name in names]
    # Where no tree is known, the fruits of none are all.
    known = enumerate(trees.names if any(trees.names) else ())
    groups += [("tree", name, trees.numbers == number) for number, name in known]
    bearing = [group for group in groups if chances[group[2]].sum() > HALF_A_FRUIT]
    return (Block(ALL, "", chances), *(Block(kind, name, chances * own) for kind, name, own in bearing))


def block_means(blocks: tuple[Block, ...]) -> Summary:
    """Mean size of each block at each time and its mean rate in the last column, (B, Q + 1)."""

    def summary(
        sizes_mm: NDArray[np.float64], rates_mm_per_day: NDArray[np.float64], _hangs: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        everything = np.column_stack([sizes_mm, rates_mm_per_day])
        return np.array([block.mean_of(everything) for block in blocks])

    return summary


def block_counts(blocks: tuple[Block, ...]) -> Summary:
    """How many fruits of each block hang, (B,)."""
    members = np.array([block.chances > 0.0 for block in blocks])

    def summary(
        _sizes: NDArray[np.float64], _rates: NDArray[np.float64], hangs: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return np.asarray(members @ hangs)

    return summary
