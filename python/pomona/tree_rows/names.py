"""Names of trees for fruits of which nobody has written down any."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.tree_rows.row_lines import row_lines
from pomona.tree_rows.tree_spacing import planting_of

__all__ = ["tree_name", "tree_names"]


def tree_name(row: int, n_rows: int, number: int) -> str:
    """Return the name of a tree by the numbers of its row and of itself; in the only row the one says all."""
    return str(number) if n_rows == 1 else f"{row}-{number}"


def tree_names(positions: NDArray[np.float64]) -> tuple[str, ...]:
    """Return the tree of each fruit, (N,), blank where none can be told."""
    names = np.full(len(positions), "", dtype=object)
    lines = row_lines(positions)
    for row, line in enumerate(lines, 1):
        planting = planting_of(positions[line.members], line.along_m, line.beside_m)
        bearers, _ = planting.bearers(line.along_m, line.beside_m)
        told = bearers >= 0
        names[line.members[told]] = [tree_name(row, len(lines), number + 1) for number in bearers[told].tolist()]
    return tuple(names.tolist())
