"""Rows with what they tell of their trees; where nobody drove along them, the fruits say which way they run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pomona.tree_rows.row_lines import RowLine, row_lines
from pomona.tree_rows.tree_spacing import Planting, planting_of

__all__ = ["rows_of_parts", "told_rows"]

ToldRows = list[tuple[RowLine, Planting]]

SAME_WAY = 0.966
"""Cosine of the angle, 15 degrees, within which two directions are two measurements of one row's."""


def rows_of_parts(
    positions: NDArray[np.float64],
    parts: NDArray[np.int64],
    ways: Mapping[int, Sequence[NDArray[np.float64]]],
    spacing_m: float | None = None,
) -> ToldRows:
    """Return the rows of fruits of a map, part by part: how parts lie to each other nobody knows.

    Parameters
    ----------
    positions : (N, 3) float64
    parts : (N,) int64
    ways : mapping of int to sequence of (F, 3) float64
        As in `told_rows`, by part.
    spacing_m : float, optional
    """
    rows: ToldRows = []
    for part in np.unique(parts).tolist():
        own = np.flatnonzero(parts == part)
        told = told_rows(positions[own], ways.get(part, ()), spacing_m)
        rows += [(replace(line, members=own[line.members]), planting) for line, planting in told]
    return rows


def told_rows(
    positions: NDArray[np.float64], ways: Sequence[NDArray[np.float64]] = (), spacing_m: float | None = None
) -> ToldRows:
    """Return the rows of fruits, in order across them, and how each is planted.

    Without ways of cameras a short row can be taken for trees one above the other. Then the longest extent of all
    fruits is asked too. Of one row that is the better measurement where both are much alike: of drawn rows of five
    trees it is off by 3 degrees, the other by 7. Where they are not, or there are several rows, the direction is taken
    in which more speaks for trees.

    Parameters
    ----------
    positions : (N, 3) float64
    ways : sequence of (F, 3) float64
    spacing_m : float, optional
        As in `row_lines` and `planting_of`.
    """
    lines = row_lines(positions, ways)
    if len(positions) < 2 or any(len(way) > 1 for way in ways):
        return _told(positions, lines, spacing_m)
    longest = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)[2][0]
    others = row_lines(positions, direction=longest)
    other = _told(positions, others, spacing_m)
    # More evidence in one of two such directions would be chance, of which a wrong number of trees is made.
    if len(lines) == len(others) == 1 and abs(lines[0].direction @ longest) > SAME_WAY:
        return other
    told = _told(positions, lines, spacing_m)
    return other if _evidence(other) > _evidence(told) else told


def _told(positions: NDArray[np.float64], lines: Sequence[RowLine], spacing_m: float | None) -> ToldRows:
    return [(line, planting_of(positions[line.members], line.along_m, line.beside_m, spacing_m)) for line in lines]


def _evidence(told: ToldRows) -> float:
    return sum(planting.log_odds for _, planting in told if planting.crowns is not None)
