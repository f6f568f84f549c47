"""Where the trees of a row stand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona.tree_rows.told_rows import told_rows

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud

__all__ = ["Trees"]


@dataclass(frozen=True, eq=False)
class Trees:
    """Where the trees of a row stand along it.

    Attributes
    ----------
    places : (T,) float64
        Metres, ascending.
    names : tuple of T str
        Their names where they are known; else each is a guess.
    """

    places: NDArray[np.float64]
    names: tuple[str, ...] | None

    @classmethod
    def along(cls, axis: NDArray[np.float64], map: FruitCloud, everything: NDArray[np.float64]) -> Trees:
        """Take the trees that a column `tree` of the map names; else those that the fruits tell, if any.

        Parameters
        ----------
        axis
            (3,) unit vector along the row.
        map
            The map.
        everything
            (N, 3) fruits of both visits in the map's frame, to find them from.
        """
        if "tree" not in map.extras:
            return cls(_found(axis, everything), None)
        of_fruits = np.array(map.extras["tree"])
        place_of = {
            str(name): (map.positions[of_fruits == name] @ axis).mean() for name in set(of_fruits.tolist()) - {""}
        }
        names = sorted(place_of, key=place_of.__getitem__)
        return cls(np.array([place_of[name] for name in names]), tuple(names))


def _found(axis: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the trees of the only row; several rows would be drawn over each other."""
    rows = told_rows(positions)
    if len(rows) != 1:
        return np.empty(0)
    line, planting = rows[0]
    return np.empty(0) if planting.crowns is None else np.sort(line.places(planting.crowns.places_m) @ axis)
