"""What became of each fruit between two visits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona.torn_rows import laid_in_parts

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud
    from pomona.matching import Match

__all__ = ["Fates"]

NEIGHBOURS = 5
"""A fruit was in view when most of its five nearest fruits were seen: as many as make a constellation."""


@dataclass(frozen=True, eq=False)
class Fates:
    """Fruits of a query that was found, and of its map, in the map's frame.

    Attributes
    ----------
    was, found : (M, 3) float64
        Where the fruits that were found again hung, and where they hang.
    new : (A, 3) float64
        Fruits of the query that the map does not know.
    missed : (B, 3) float64
        Fruits of the map that the query should have seen, as most of their neighbours were, and did not.
    elsewhere : (C, 3) float64
        Fruits of the map where the query did not look.
    """

    was: NDArray[np.float64]
    found: NDArray[np.float64]
    new: NDArray[np.float64]
    missed: NDArray[np.float64]
    elsewhere: NDArray[np.float64]

    @classmethod
    def of(cls, query: FruitCloud, map: FruitCloud, match: Match) -> Fates:
        """Tell them apart."""
        in_map = laid_in_parts(match, query).positions if match.parts else query.positions
        again, known = match.pairs.T
        seen = np.isin(np.arange(len(map)), known)
        missed = np.isin(np.arange(len(map)), _in_view_unseen(map.positions, seen))
        return cls(
            was=map.positions[known],
            found=in_map[again],
            new=np.delete(in_map, again, axis=0),
            missed=map.positions[missed],
            elsewhere=map.positions[~seen & ~missed],
        )


def _in_view_unseen(positions: NDArray[np.float64], seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the rows of known fruits, (N, 3), that were in view, by their neighbours, and were not seen, (N,)."""
    from scipy.spatial import cKDTree

    neighbours = min(NEIGHBOURS, len(positions) - 1)
    unseen = np.flatnonzero(~seen)
    if neighbours < 1 or not len(unseen):
        return unseen[:0]
    _, nearest = cKDTree(positions).query(positions[unseen], k=list(range(2, neighbours + 2)))
    in_view: NDArray[np.bool_] = 2 * seen[nearest].sum(axis=1) > neighbours
    return unseen[in_view]
