"""What became of each fruit between two visits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona.orchard.replay import in_view_unseen

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud
    from pomona.matching import Match

__all__ = ["Fates"]


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
        pose = np.eye(4) if match.map_from_query is None else match.map_from_query
        in_map = query.positions @ pose[:3, :3].T + pose[:3, 3]
        again, known = match.pairs.T
        seen = np.isin(np.arange(len(map)), known)
        missed = np.isin(np.arange(len(map)), in_view_unseen(map.positions, seen))
        return cls(
            was=map.positions[known],
            found=in_map[again],
            new=np.delete(in_map, again, axis=0),
            missed=map.positions[missed],
            elsewhere=map.positions[~seen & ~missed],
        )
