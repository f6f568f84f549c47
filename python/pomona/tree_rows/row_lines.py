"""Fruits parted into rows, and each row unrolled: how far along it a fruit hangs, and how high or deep beside that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["RowLine", "row_lines"]

CELL_M = (4.0, 0.35, 0.35)
"""Along a row and across: fruits in touching cells are of one row. Trees that miss leave no such hole, alleys do."""

LEAST_IN_CELL = 2
"""A cell with one fruit links nothing: false detections are alone."""

REACH_M = 0.7
"""A fruit beside a row's cells is still of it."""

LEAST_FRUITS = 20
"""Fewer are no row of which anything could be told."""

LEAST_SHARE = 0.02
"""Of the largest row."""

BEND_EVERY_M = 8.0
"""A row may turn once in so much; a polynomial of at most the third degree."""

LEAST_TRAVEL_M = 1.0
LEAST_STRAIGHTNESS = 3.0
"""A way that is longer than this, and so many times as long as wide, runs along a row."""

LOOKED_AT = 1500
"""Of more fruits, so many tell the direction as well."""

GRID_M = 0.25


@dataclass(frozen=True, eq=False)
class RowLine:
    """One row.

    Attributes
    ----------
    members : (M,) int64
        Its fruits.
    along_m : (M,) float64
        Arc length along the row's own curve, from its first fruit.
    beside_m : (M, 2) float64
        Beyond the curve, the larger extent first: heights, if the row is higher than deep.
    direction : (3,) float64
        Unit vector of the row as a whole.
    knots_m : (J, 4) float64
        Arc length and place of points of the curve, ascending.
    """

    members: NDArray[np.int64]
    along_m: NDArray[np.float64]
    beside_m: NDArray[np.float64]
    direction: NDArray[np.float64]
    knots_m: NDArray[np.float64]

    def places(self, along_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points of the curve, (K, 3); beyond its ends it goes straight on."""
        at = np.clip(along_m, self.knots_m[0, 0], self.knots_m[-1, 0])
        on = np.stack([np.interp(at, self.knots_m[:, 0], column) for column in self.knots_m[:, 1:].T], axis=1)
        return np.asarray(on + (along_m - at)[:, None] * self.direction)

    def along_of(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far along the row points are, (K, 3) to (K,)."""
        forwards = self.knots_m[:, 1:] @ self.direction
        asked = points @ self.direction
        inside = np.interp(asked, forwards, self.knots_m[:, 0])
        return np.asarray(inside + (asked - np.clip(asked, forwards[0], forwards[-1])))


def row_lines(
    positions: NDArray[np.float64],
    ways: Sequence[NDArray[np.float64]] = (),
    direction: NDArray[np.float64] | None = None,
) -> list[RowLine]:
    """Part fruits into rows, in order across them; fruits of none are in none.

    Parameters
    ----------
    positions : (N, 3) float64
        Metres.
    ways : sequence of (F, 3) float64
        Where cameras went, one array a session: they drive along the rows. Without, a row is seen end on where its
        fruits cover least.
    direction : (3,) float64, optional
        Along the rows, where it is known.
    """
    if len(positions) < LEAST_FRUITS:
        return []
    if direction is None:
        direction = _travelled(ways)
    if direction is None:
        direction = _seen_end_on(positions)
    direction = direction * (1.0 if direction[np.argmax(np.abs(direction))] > 0 else -1.0)
    frame = np.vstack([direction, _across(direction, positions)])
    unrolled = positions @ frame.T
    labels = _labels(unrolled)
    lines = [
        _line(np.flatnonzero(labels == row), unrolled[labels == row], frame)
        for row in range(labels.max(initial=-1) + 1)
    ]
    middles = np.array([np.median(unrolled[line.members, 1:], axis=0) for line in lines]).reshape(-1, 2)
    spread = np.ptp(middles, axis=0) if len(lines) else np.zeros(2)
    return [lines[row] for row in np.argsort(middles[:, int(np.argmax(spread))], kind="stable")]


def _travelled(ways: Sequence[NDArray[np.float64]]) -> NDArray[np.float64] | None:
    """Return the direction that cameras went in, where it is plain."""
    centred = [way - way.mean(axis=0) for way in ways if len(way) > 1]
    if not centred:
        return None
    _, extents, axes = np.linalg.svd(np.concatenate(centred), full_matrices=True)
    length = max(float(np.ptp(way @ axes[0])) for way in centred)
    is_plain = length > LEAST_TRAVEL_M and extents[0] > LEAST_STRAIGHTNESS * extents[1]
    return axes[0] if is_plain else None


def _seen_end_on(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the direction of sight that piles the fruits up most; turned in ever finer steps from every side."""
    some = positions[:: max(1, len(positions) // LOOKED_AT)]
    some = some - some.mean(axis=0)
    best = max(_hemisphere(600), key=lambda sight: _piled(some, sight))
    for turn_rad in (0.08, 0.03, 0.01):
        around = _hemisphere(60)
        best = max([best, *_unit(best + turn_rad * around)], key=lambda sight: _piled(some, sight))
    return np.asarray(best)


def _hemisphere(count: int) -> NDArray[np.float64]:
    """Return directions evenly over half a sphere, by the golden angle."""
    number = np.arange(count)
    z = (number + 0.5) / count
    turn = number * np.pi * (3.0 - np.sqrt(5.0))
    flat = np.sqrt(1.0 - z**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _piled(positions: NDArray[np.float64], sight: NDArray[np.float64]) -> float:
    """Return how many pairs of fruits fall into one cell of the picture."""
    cells = np.floor(positions @ _perpendicular(sight).T / GRID_M).astype(np.int64)
    counts = np.unique(cells @ np.array([1 << 20, 1]), return_counts=True)[1]
    return float((counts.astype(np.float64) ** 2).sum())


def _perpendicular(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return two unit vectors, (2, 3), across a direction."""
    one = _unit(np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))]))
    return np.stack([one, np.cross(direction, one)])


def _across(direction: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the axes across the rows along which the fruits as a whole reach farthest and least."""
    basis = _perpendicular(direction)
    flat = (positions - positions.mean(axis=0)) @ basis.T
    turn = np.linalg.svd(flat.T @ flat)[2]
    return np.asarray(turn @ basis)


def _labels(unrolled: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the row of each fruit, -1 for none: cells that touch, and what hangs just beside them."""
    from scipy.ndimage import label
    from scipy.spatial import KDTree

    cells = np.floor((unrolled - unrolled.min(axis=0)) / CELL_M).astype(np.int64)
    used, cell, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    # Far strays would make the grid large: what is alone is left out of it, and empty planes are closed up.
    kept = counts >= LEAST_IN_CELL
    if not kept.any():
        return np.full(len(unrolled), -1)
    dense = np.stack([_closed_up(column) for column in used[kept].T], axis=1)
    grid = np.zeros(dense.max(axis=0) + 1, bool)
    grid[tuple(dense.T)] = True
    parts = label(grid, np.ones((3, 3, 3)))[0][tuple(dense.T)] - 1
    of_cells = np.full(len(used), -1)
    of_cells[kept] = parts
    labels = of_cells[cell.reshape(-1)]
    inside, outside = np.flatnonzero(labels >= 0), np.flatnonzero(labels < 0)
    scaled = unrolled * (CELL_M[1] / np.array(CELL_M))
    distances, nearest = KDTree(scaled[inside]).query(scaled[outside])
    labels[outside] = np.where(distances <= REACH_M, labels[inside[nearest]], -1)
    return _large(labels)


def _closed_up(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return numbers of cells in which what was apart by more than one is apart by two."""
    used, inverse = np.unique(cells, return_inverse=True)
    steps = np.minimum(np.diff(used, prepend=used[0]), 2)
    return np.asarray(np.cumsum(steps)[inverse])


def _large(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return labels without gaps of the rows that are large enough, -1 for the others."""
    counts = np.bincount(labels[labels >= 0])
    large = counts >= max(LEAST_FRUITS, LEAST_SHARE * counts.max(initial=0))
    numbers = np.where(large, np.cumsum(large) - 1, -1)
    return np.where(labels >= 0, numbers[labels], -1)


def _line(members: NDArray[np.int64], unrolled: NDArray[np.float64], frame: NDArray[np.float64]) -> RowLine:
    forwards, across = unrolled[:, 0], unrolled[:, 1:]
    low, high = forwards.min(), forwards.max()
    degree = int(min(3, (high - low) // BEND_EVERY_M))
    middle, half = (low + high) / 2.0, max((high - low) / 2.0, 1e-9)
    curve = np.polynomial.polynomial.polyfit((forwards - middle) / half, across, degree)
    knots = np.linspace(low, high, max(2, round(high - low) + 1))

    def beside(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.polynomial.polynomial.polyval((at - middle) / half, curve).reshape(2, -1).T)

    on = np.column_stack([knots, beside(knots)])
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(on, axis=0), axis=1))])
    rest = across - beside(forwards)
    return RowLine(
        members=members,
        along_m=np.interp(forwards, knots, lengths),
        beside_m=rest @ np.linalg.svd(rest.T @ rest)[2].T,
        direction=frame[0],
        knots_m=np.column_stack([lengths, on @ frame]),
    )
