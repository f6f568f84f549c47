"""Planes that clouds are drawn in: from above and from the side, with the row to the right."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Projection", "side_and_plan", "view_from_above"]


@dataclass(frozen=True, eq=False)
class Projection:
    """The plane a cloud is drawn in.

    Attributes
    ----------
    axes
        (2, 3) orthonormal; to the right and upwards in the picture.
    labels
        What the two axes are, without the unit.
    """

    axes: NDArray[np.float64]
    labels: tuple[str, str]

    def project(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coordinates of (N, 3) positions in the picture, (N, 2)."""
        return positions @ self.axes.T


def view_from_above(positions: NDArray[np.float64], up: ArrayLike | None = None) -> Projection:
    """Look down the vertical with the row to the right; without a vertical, onto the two largest extents.

    Parameters
    ----------
    positions
        (N, 3) metres.
    up
        The vertical in the frame of the positions, of any length but zero.
    """
    if up is None:
        along, across = _principal_axes(positions)[:2]
        return Projection(
            np.stack([along, across]), ("along the largest extent", "along the second extent, vertical unknown")
        )
    vertical = np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
    horizontal = positions - np.outer(positions @ vertical, vertical)
    along = _principal_axes(horizontal)[0]
    along = along - (along @ vertical) * vertical
    if np.linalg.norm(along) < 1e-9:  # all fruits on one vertical: any horizontal direction will do
        along = np.cross(vertical, np.eye(3)[np.argmin(np.abs(vertical))])
    along /= np.linalg.norm(along)
    return Projection(
        np.stack([along, np.cross(vertical, along)]), ("along the row", "across the row, seen from above")
    )


def side_and_plan(positions: NDArray[np.float64], up: ArrayLike | None = None) -> tuple[Projection, Projection]:
    """Look at the row from its side and from above, the row to the right in both; parameters as above.

    Without a vertical the extents stand for it: a row is longer than high, and higher than deep.
    """
    if up is None:
        along, second, third = _principal_axes(positions)
        return (
            Projection(np.stack([along, second]), ("along the row", "second extent")),
            Projection(np.stack([along, third]), ("along the row", "third extent")),
        )
    plan = view_from_above(positions, up)
    vertical = np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
    return (
        Projection(np.stack([plan.axes[0], vertical]), ("along the row", "height")),
        Projection(plan.axes, ("along the row", "across the row")),
    )


def _principal_axes(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) directions of falling extent as rows; the largest component of each is positive, so that none flips."""
    if len(positions) == 0:
        return np.eye(3)
    axes: NDArray[np.float64] = np.linalg.svd(positions - positions.mean(axis=0))[2]
    largest = axes[np.arange(3), np.argmax(np.abs(axes), axis=1)]
    return axes * np.where(largest < 0.0, -1.0, 1.0)[:, None]
