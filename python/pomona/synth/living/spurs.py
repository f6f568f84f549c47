"""Spurs: short wood on the branches; rosettes of leaves stand on them, and fruits hang from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.living.axis_growth import perpendiculars, unit
from pomona.synth.living.wood import along_axes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.living.wood import WoodAxes

__all__ = ["Spurs", "grow_spurs"]

_LENGTHS_M = (0.008, 0.05)


@dataclass(frozen=True, eq=False)
class Spurs:
    """Spurs at rest.

    Attributes
    ----------
    axes : (S,) int64
    places : (S,)
        Where on its axis, 0 to 1.
    offsets_m : (S, 3)
        From the middle of the axis to the spur's tip.
    trees : (S,) int64
    """

    axes: NDArray[np.int64]
    places: NDArray[np.float64]
    offsets_m: NDArray[np.float64]
    trees: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.axes)

    def roots(self, nodes_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points in the middle of the axes, (S, 3), of wood with these nodes."""
        return along_axes(nodes_m, self.axes, self.places)


def grow_spurs(rng: np.random.Generator, wood: WoodAxes, per_tree: int) -> Spurs:
    """Draw spurs evenly over the length of the wood that bears."""
    weights = wood.lengths_m * wood.bears
    chosen, places = [], []
    for tree in range(int(wood.trees.max()) + 1):
        of_tree = np.flatnonzero((wood.trees == tree) & wood.bears)
        ends = np.cumsum(weights[of_tree])
        at = (np.arange(per_tree) + rng.uniform(0.0, 1.0, per_tree)) / per_tree * ends[-1]
        which = np.minimum(np.searchsorted(ends, at), len(of_tree) - 1)
        chosen.append(of_tree[which])
        places.append(1.0 - (ends[which] - at) / weights[of_tree][which])
    axes, place = np.concatenate(chosen), np.clip(np.concatenate(places), 0.0, 1.0)
    tangents = wood.tangents(axes, place)
    across = perpendiculars(tangents, rng.uniform(-0.6, np.pi + 0.6, len(axes)))
    directions = unit(across + 0.35 * tangents)
    lengths = along_axes(wood.radii_m, axes, place) + rng.uniform(*_LENGTHS_M, len(axes))
    return Spurs(axes, place, directions * lengths[:, None], wood.trees[axes])
