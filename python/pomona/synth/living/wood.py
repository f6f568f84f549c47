"""The wood of a row at rest: axes of nodes, each grown out of a place on another; trunks grow out of the ground."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["NODES", "TRUNK", "WoodAxes", "along_axes"]

NODES = 10
"""Of an axis: a branch of 0.9 m in pieces of 10 cm looks curved."""

TRUNK = -1
"""Parent of a trunk."""


@dataclass(frozen=True, eq=False)
class WoodAxes:
    """Axes in the row frame, before any load.

    Attributes
    ----------
    nodes_m : (A, NODES, 3)
    radii_m : (A, NODES)
    parents : (A,) int64
        Axis that it grows out of, always an earlier one; `TRUNK` for none.
    parent_places : (A,)
        Where on the parent, 0 at its root to 1 at its tip.
    orders : (A,) int64
        0 for trunks; an axis is one above its parent.
    trees : (A,) int64
    stiffness : (A,)
        Factor of the wood's own; tied to wires an axis hardly bends.
    bears : (A,) bool
        Whether spurs stand on it.
    """

    nodes_m: NDArray[np.float64]
    radii_m: NDArray[np.float64]
    parents: NDArray[np.int64]
    parent_places: NDArray[np.float64]
    orders: NDArray[np.int64]
    trees: NDArray[np.int64]
    stiffness: NDArray[np.float64]
    bears: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.parents)

    @property
    def lengths_m(self) -> NDArray[np.float64]:
        """Length of each axis, (A,)."""
        return np.asarray(np.linalg.norm(np.diff(self.nodes_m, axis=1), axis=2).sum(axis=1))

    def tangents(self, axes: NDArray[np.int64], places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give unit vectors towards the tip at places of axes, (N, 3)."""
        below = np.minimum((places * (NODES - 1)).astype(np.int64), NODES - 2)
        steps = self.nodes_m[axes, below + 1] - self.nodes_m[axes, below]
        return np.asarray(steps / np.linalg.norm(steps, axis=1, keepdims=True))


def along_axes(
    values: NDArray[np.float64], axes: NDArray[np.int64], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Interpolate what is known at nodes, (A, NODES, ...), at places 0 to 1 of axes; (N, ...)."""
    position = places * (NODES - 1)
    below = np.minimum(position.astype(np.int64), NODES - 2)
    share = (position - below).reshape(-1, *[1] * (values.ndim - 2))
    return np.asarray(values[axes, below] * (1.0 - share) + values[axes, below + 1] * share)


def joined(parts: Sequence[WoodAxes]) -> WoodAxes:
    """Put axes together; the parents of each part count from the first part's first axis."""
    return WoodAxes(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(WoodAxes)))
