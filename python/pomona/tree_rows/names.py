"""Names of trees for fruits of which nobody has written down any."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.tree_rows.told_rows import rows_of_parts

__all__ = ["tree_name", "tree_names"]


def tree_name(row: int, n_rows: int, number: int) -> str:
    """Return the name of a tree by the numbers of its row and of itself; in the only row the one says all."""
    return str(number) if n_rows == 1 else f"{row}-{number}"


def tree_names(
    positions: NDArray[np.float64], parts: NDArray[np.int64], ways: Mapping[int, Sequence[NDArray[np.float64]]]
) -> tuple[str, ...]:
    """Return the tree of each fruit, (N,), blank where none can be told; `parts` and `ways` as for `rows_of_parts`."""
    names = np.full(len(positions), "", dtype=object)
    lines = rows_of_parts(positions, parts, ways)
    for row, (line, planting) in enumerate(lines, 1):
        bearers, _ = planting.bearers(line.along_m, line.beside_m)
        told = bearers >= 0
        names[line.members[told]] = [tree_name(row, len(lines), number + 1) for number in bearers[told].tolist()]
    return tuple(names.tolist())
