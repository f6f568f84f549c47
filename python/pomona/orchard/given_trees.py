"""Trees that are known: out of a table of places, or drawn in the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import number_in, shown
from pomona.table_lines import table_lines

__all__ = ["KnownTree", "read_trees"]

_EXPECTED = "x,y,z of each tree in metres of the map, and name if it has one"
_PLACE = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class KnownTree:
    """A tree that somebody has told.

    Attributes
    ----------
    name : str
        Blank where it has none.
    place_in_map : (3,) float64
    tree_id : int
        Its number in the map's layer of trees; 0 where it is not there yet.
    """

    name: str
    place_in_map: NDArray[np.float64]
    tree_id: int = 0


def read_trees(path: Path) -> Sequence[KnownTree]:
    """Read a table of trees: columns x, y, z in metres of the map, and name if trees have one.

    Raises
    ------
    PomonaError
        One line: a column that is missing, a coordinate that is no number, a name that is there twice, no tree at all.
    """
    lines = table_lines(path, _EXPECTED)
    header = [name.strip() for name in next(lines)[1]]
    missing = next((name for name in _PLACE if header.count(name) != 1), None)
    if missing is not None or header.count("name") > 1:
        raise PomonaError(f"{path}: found the header {shown(','.join(header))}, expected {_EXPECTED}")
    trees: dict[str, KnownTree] = {}
    for where, cells in lines:
        row = dict(zip(header, cells, strict=True))
        name = row.get("name", "").strip()
        place = np.array([number_in(where, column, row[column]) for column in _PLACE])
        if name and name in trees:
            raise PomonaError(f"{where}: found tree {shown(name)} a second time, expected each once")
        trees[name or where] = KnownTree(name, place)
    if not trees:
        raise PomonaError(f"{path}: found no trees, expected {_EXPECTED}")
    return tuple(trees.values())
