"""Whole blocks: the orchard, each row and each tree, how many fruits, how big on average, how fast."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.growth.bearing_trees import as_counted
from pomona.growth.foretelling import Summary
from pomona.growth.measured import MeasuredFruits

__all__ = ["ALL", "Block", "block_means", "blocks_of"]

ALL = "all"
"""The block of all fruits."""


@dataclass(frozen=True, eq=False)
class Block:
    """The fruits that are counted together: the hanging ones of a tree, of a row, or all.

    Attributes
    ----------
    kind : {"all", "row", "tree"}
    name : str
        Of the row or the tree; blank for all, and for the fruits of no tree.
    members : (N,) bool
    """

    kind: str
    name: str
    members: NDArray[np.bool_]

    @property
    def title(self) -> str:
        """What to call it: a name that says what it is, as of row 1, says it once."""
        if not self.name:
            return ALL if self.kind == ALL else f"no {self.kind}"
        return self.name if self.name.lower().startswith(self.kind) else f"{self.kind} {self.name}"


def blocks_of(fruits: MeasuredFruits) -> tuple[Block, ...]:
    """All hanging fruits, those of each row where the map has several, those of each tree, and then of no tree."""
    hanging, trees = fruits.hanging, fruits.trees
    rows = np.array(fruits.cloud.extras.get("row", ("",) * len(hanging)))
    of_rows = [
        Block("row", name, hanging & (rows == name)) for name in sorted(set(rows.tolist()) - {""}, key=as_counted)
    ]
    # Where no tree is known, the fruits of none are all.
    known = enumerate(trees.names if any(trees.names) else ())
    of_trees = [Block("tree", name, hanging & (trees.numbers == number)) for number, name in known]
    return (Block(ALL, "", hanging), *(block for block in (*of_rows, *of_trees) if block.members.any()))


def block_means(blocks: tuple[Block, ...]) -> Summary:
    """Mean size of each block at each time and its mean rate in the last column, (B, Q + 1)."""

    def summary(sizes_mm: NDArray[np.float64], rates_mm_per_day: NDArray[np.float64]) -> NDArray[np.float64]:
        everything = np.column_stack([sizes_mm, rates_mm_per_day])
        return np.array([everything[block.members].mean(axis=0) for block in blocks])

    return summary
