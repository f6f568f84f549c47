"""Measured diameters as a table of fruits and visits, as the model takes them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pomona.growth.straying import straying

__all__ = ["SizeTable"]

_SEED = 23


@dataclass(frozen=True, eq=False)
class SizeTable:
    """Diameters of N fruits on S visits, fruits in order of their trees.

    Attributes
    ----------
    logs : (N, S) float64
        Natural logarithms of diameters in mm, NaN where a visit did not measure the fruit.
    trees : (N,) int64
        Tree of each fruit, 0 to T - 1, ascending.
    times : (S,) float64
        Time of each visit, days or degree days in the length of days, ascending.
    typical_mm : (S,) float64
        Usual diameter of a visit, by which an error in mm is one of the logarithm.
    trust : (N, S) float64
        Probability that a size is its fruit's own, see `trust_in_sizes`: the share by which it counts.
    doubt : (S,) float64
        Variance of the logarithm of each visit's scale, beside what all visits have: 0, but see `odd_visits`.
    """

    logs: NDArray[np.float64]
    trees: NDArray[np.int64]
    times: NDArray[np.float64]
    typical_mm: NDArray[np.float64]
    trust: NDArray[np.float64]
    doubt: NDArray[np.float64]

    @classmethod
    def of(cls, diameters_mm: NDArray[np.float64], trees: NDArray[np.int64], times: NDArray[np.float64]) -> SizeTable:
        """Take (N, S) diameters, NaN for none; every visit has at least one, and all are trusted."""
        trust = np.ones(diameters_mm.shape)
        typical_mm = np.nanmedian(diameters_mm, axis=0)
        return cls(np.log(diameters_mm), trees, times, typical_mm, trust, np.zeros(len(times)))

    @cached_property
    def seen(self) -> NDArray[np.bool_]:
        """Which fruit was measured when, (N, S)."""
        return ~np.isnan(self.logs)

    @cached_property
    def tree_starts(self) -> NDArray[np.int64]:
        """First row of each tree, (T,)."""
        return np.flatnonzero(np.diff(self.trees, prepend=-1))

    @cached_property
    def straying(self) -> NDArray[np.float64]:
        """How growth may stray from a curve between the visits, (S, S): see `straying`."""
        return straying(self.times)

    @cached_property
    def ranks(self) -> NDArray[np.int64]:
        """Place of each fruit among all in order of their sizes, (N,): chance goes by it, whatever the trees are."""
        ranks = np.empty(len(self.logs), np.int64)
        ranks[np.lexsort(np.where(self.seen, self.logs, 0.0).T[::-1])] = np.arange(len(ranks))
        return ranks

    def trusted(self, trust: NDArray[np.float64]) -> SizeTable:
        """Let each size count by its share, (N, S)."""
        return replace(self, trust=trust)

    def doubting(self, visit: int, variance: float) -> SizeTable:
        """Give the scale of one visit a variance of its own."""
        return replace(self, doubt=np.where(np.arange(len(self.times)) == visit, variance, 0.0))

    def first_visits(self, count: int) -> SizeTable:
        """Keep the first visits, with the fruits that they measured."""
        return self._kept(self.seen[:, :count].any(axis=1), count)

    def some_fruits(self, most: int) -> SizeTable:
        """Keep some of more fruits than that, evenly over the trees, those of many visits first, else by lot."""
        if len(self.logs) <= most:
            return self
        # Of each tree the same share, and in it the fruits that say most about growth. The lot falls on places among
        # the sizes: neither ids, which tell who was seen first, nor the sizes themselves may choose.
        lots = np.random.default_rng(_SEED).permutation(len(self.logs))[self.ranks]
        order = np.lexsort((lots, -self.seen.sum(axis=1), self.trees))
        sizes = np.diff(self.tree_starts, append=len(self.logs))
        rank = np.empty(len(order), np.int64)
        rank[order] = np.concatenate([np.arange(size) for size in sizes])
        keep = rank < np.ceil(sizes * most / len(self.logs))[self.trees]
        return self._kept(keep, self.logs.shape[1])

    def _kept(self, fruits: ArrayLike, count: int) -> SizeTable:
        fruits = np.asarray(fruits)
        trees = np.unique(self.trees[fruits], return_inverse=True)[1].astype(np.int64)
        kept = self.logs[fruits, :count], trees, self.times[:count], self.typical_mm[:count]
        return SizeTable(*kept, self.trust[fruits, :count], self.doubt[:count])
