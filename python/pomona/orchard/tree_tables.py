"""Rows and trees in the tables, and which fruit hangs on which."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.orchard.past_seasons import sessions_of_past_seasons
from pomona.store.rows import columns_of, one_of
from pomona.tree_rows import Planting

__all__ = [
    "DRAWN",
    "FOUND",
    "GIVEN",
    "StoredTree",
    "bear",
    "follow_trees",
    "stored_trees",
    "trees_of",
    "write_row",
    "write_tree",
]

DRAWN, FOUND, GIVEN = "drawn", "found", "given"
"""Where a tree comes from: people in QGIS (null in the file), the fruits, a table."""

NEIGHBOURS = 3
NEAR_M = 0.7
"""A fruit that is new hangs on the tree of most of its nearest neighbours, which are no farther."""


@dataclass(frozen=True, eq=False)
class StoredTree:
    """A row of the table; `tree_id` and `row_id` are 0 where there is none."""

    tree_id: int
    name: str
    row_id: int
    number: int | None
    along_m: float | None
    place_in_map: NDArray[np.float64]
    kind: str
    source: str
    n_fruits: int


def stored_trees(connection: sqlite3.Connection) -> list[StoredTree]:
    """Return the trees that have a place, by their numbers in the map."""
    names = ("id", "name", "row_id", "number", "along_m", "geom", "kind", "source", "n_fruits")
    return [
        StoredTree(
            tree_id, name or "", row_id or 0, number, along_m, geopackage.points_of([geom])[0], kind or "tree",
            source or DRAWN, n_fruits or 0,
        )
        for tree_id, name, row_id, number, along_m, geom, kind, source, n_fruits in zip(
            *columns_of(connection, "trees", names), strict=True
        )
        if geom is not None
    ]  # fmt: skip


def write_row(
    connection: sqlite3.Connection,
    row_id: int,
    taken: Collection[int],
    source: str,
    planting: Planting,
    line_in_map: NDArray[np.float64],
) -> tuple[int, int]:
    """Write a row, a new one where it is not known or taken; return its id and its number."""
    about = (
        geopackage.line(line_in_map), source, planting.spacing_m,
        planting.log_odds if np.isfinite(planting.log_odds) else None,
    )  # fmt: skip
    numbers = dict(zip(*columns_of(connection, "rows", ("id", "number")), strict=True))
    if row_id in numbers and row_id not in taken:
        number = numbers[row_id] or 1 + max((known for known in numbers.values() if known), default=0)
        connection.execute(
            "UPDATE rows SET geom = ?, source = ?, spacing_m = ?, spacing_log_odds = ?, number = ? WHERE id = ?",
            (*about, number, row_id),
        )
        return row_id, number
    number = 1 + max((known for known in numbers.values() if known), default=0)
    cursor = connection.execute(
        "INSERT INTO rows (geom, source, spacing_m, spacing_log_odds, number, name) VALUES (?, ?, ?, ?, ?, ?)",
        (*about, number, f"row {number}"),
    )
    return int(cursor.lastrowid or 0), number


def write_tree(connection: sqlite3.Connection, tree: StoredTree, *, is_drawn: bool = False) -> int:
    """Write a tree and return its id; what people drew keeps its place, its name and where it comes from."""
    cells = (tree.row_id, tree.number, tree.along_m, tree.kind, tree.n_fruits)
    if is_drawn:
        connection.execute(
            "UPDATE trees SET row_id = ?, number = ?, along_m = ?, kind = ?, n_fruits = ? WHERE id = ?",
            (*cells, tree.tree_id),
        )
        return tree.tree_id
    own = (geopackage.points([tree.place_in_map])[0], tree.name, tree.source)
    if tree.tree_id:
        connection.execute(
            """UPDATE trees SET row_id = ?, number = ?, along_m = ?, kind = ?, n_fruits = ?, geom = ?, name = ?,
            source = ? WHERE id = ?""",
            (*cells, *own, tree.tree_id),
        )
        return tree.tree_id
    cursor = connection.execute(
        """INSERT INTO trees (row_id, number, along_m, kind, n_fruits, geom, name, source)
        VALUES (?, ?, ?, ?, ?, ?, ?, ?)""",
        (*cells, *own),
    )
    return int(cursor.lastrowid or 0)


def bear(
    connection: sqlite3.Connection,
    fruit_ids: NDArray[np.int64],
    tree_ids: NDArray[np.int64],
    chances: NDArray[np.float64] | None,
) -> None:
    """Say on which tree fruits hang, 0 for none, and how likely it is that one."""
    known = np.ones(len(fruit_ids)) if chances is None else chances
    connection.executemany(
        "UPDATE fruits SET tree_id = ?, tree_probability = ? WHERE id = ?",
        (
            (tree_id or None, round(chance, 6) if tree_id else None, fruit_id)
            for fruit_id, tree_id, chance in zip(fruit_ids.tolist(), tree_ids.tolist(), known.tolist(), strict=True)
        ),
    )


def trees_of(connection: sqlite3.Connection, fruit_ids: Iterable[int]) -> set[int]:
    """Return the trees on which some of these fruits hang."""
    (tree_ids,) = columns_of(connection, "fruits", ("tree_id",), one_of("fruits.id", sorted(fruit_ids)))
    return set(tree_ids) - {None}


def follow_trees(connection: sqlite3.Connection, fruit_ids: Collection[int], trees_before: Collection[int]) -> None:
    """Give those of some fruits that have no tree that of their neighbours, and count again those of the last season.

    Nothing without trees.

    Parameters
    ----------
    connection
        The map.
    fruit_ids
        Fruits to which something came or from which something went.
    trees_before
        Those on which they hung before.
    """
    (a_tree,) = connection.execute("SELECT max(tree_id) FROM fruits").fetchone()
    if a_tree is None:
        return
    ids, geoms, tree_ids = columns_of(
        connection, "fruits", ("id", "geom", "tree_id"), one_of("fruits.id", sorted(fruit_ids))
    )
    new = [row for row, tree_id in enumerate(tree_ids) if tree_id is None]
    if new:
        _follow_neighbours(connection, np.array(ids, np.int64)[new], geopackage.points_of([geoms[row] for row in new]))
    counted = trees_of(connection, fruit_ids) | set(trees_before)
    past = ", ".join(f"{one:d}" for one in sessions_of_past_seasons(connection))
    connection.executemany(
        f"""UPDATE trees SET n_fruits = (SELECT count(*) FROM fruits
        WHERE tree_id = trees.id AND last_session_id NOT IN ({past})) WHERE id = ?""",
        ((tree_id,) for tree_id in sorted(counted)),
    )


def _follow_neighbours(
    connection: sqlite3.Connection, fruit_ids: NDArray[np.int64], positions: NDArray[np.float64]
) -> None:
    """Hang fruits on the tree of most of what hangs near them."""
    from scipy.spatial import KDTree

    (low_x, low_y, _), (high_x, high_y, _) = positions.min(axis=0) - NEAR_M, positions.max(axis=0) + NEAR_M
    around = f"""WHERE tree_id NOTNULL AND fruits.id IN (SELECT id FROM rtree_fruits_geom
        WHERE maxx >= {low_x:.9g} AND minx <= {high_x:.9g} AND maxy >= {low_y:.9g} AND miny <= {high_y:.9g})
        ORDER BY fruits.id"""
    geoms, tree_ids = columns_of(connection, "fruits", ("geom", "tree_id"), around)
    if not geoms:
        return
    trees = np.array([*tree_ids, 0], np.int64)
    # What is farther is told by the row after the last.
    _, nearest = KDTree(geopackage.points_of(geoms)).query(
        positions, k=np.arange(1, NEIGHBOURS + 1), distance_upper_bound=NEAR_M
    )
    votes = trees[nearest]
    same = (votes[:, :, None] == votes[:, None, :]).sum(axis=2) * (votes > 0)
    best = same.argmax(axis=1)
    rows = np.arange(len(fruit_ids))
    bear(connection, fruit_ids, votes[rows, best], same[rows, best] / NEIGHBOURS)
