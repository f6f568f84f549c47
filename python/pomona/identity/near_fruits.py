"""Which fruits of a visit are near each other, and near places that are asked for: looked up once for all who ask."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["AskedPlaces", "NearFruits"]

KEPT = 25
"""Fruits around each that are looked up, itself the first: the most that anybody asks for."""


@dataclass(frozen=True, eq=False)
class NearFruits:
    """The fruits of a visit, and those around each of them.

    Attributes
    ----------
    positions : (N, 3) float64
    """

    positions: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.positions)

    def spacings_m(self, count: int) -> NDArray[np.float64]:
        """Return how far the so manieth fruit is from each, itself the first, (N,); infinite where there are fewer."""
        return self.around[0][:, count - 1] if count <= len(self) else np.full(len(self), np.inf)

    def rows(self, count: int) -> NDArray[np.int64]:
        """Return so many of the fruits around each, itself the first, (N, count); all where there are fewer."""
        return self.around[1][:, :count]

    @cached_property
    def around(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Distances in metres and rows of the nearest fruits of each, (N, n) both."""
        return self.nearest(self.positions, KEPT)

    def nearest(self, places: NDArray[np.float64], count: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return distances in metres and rows of the fruits nearest to each place, (K, n) both."""
        n = min(count, len(self))
        if not n:
            return np.empty((len(places), 0)), np.empty((len(places), 0), np.int64)
        distances_m, rows = self._tree.query(places, k=list(range(1, n + 1)))
        return distances_m, rows

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.positions)


@dataclass(frozen=True, eq=False)
class AskedPlaces:
    """Places of which a visit is asked, most of them those of its own fruits.

    Attributes
    ----------
    places : (K, 3) float64
    fruits : NearFruits
        Of the visit, in the same frame.
    own : (K,) int64
        The fruit of the visit that lies at each place, -1 where none does.
    """

    places: NDArray[np.float64]
    fruits: NearFruits
    own: NDArray[np.int64]

    @cached_property
    def nearest(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Distances in metres and rows of the fruits of the visit nearest to each place, (K, n) both."""
        around = self.fruits.around
        elsewhere = np.flatnonzero(self.own < 0)
        distances_m, rows = around[0][self.own], around[1][self.own]
        distances_m[elsewhere], rows[elsewhere] = self.fruits.nearest(self.places[elsewhere], KEPT)
        return distances_m, rows
