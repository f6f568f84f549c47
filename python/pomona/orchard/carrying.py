"""What another map knows besides its sessions, into the map that takes them: what does not contradict what is there."""

from __future__ import annotations

import json
import sqlite3
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.amounts import amount
from pomona.orchard.besides import POINT_NAMES, Besides, KnownRow
from pomona.orchard.earth_layers import stored_anchor
from pomona.orchard.moving import moved_places
from pomona.orchard.tree_tables import DRAWN, NEAR_M, StoredTree, bear, stored_trees
from pomona.store.numbering import last_ids
from pomona.store.rows import columns_of

__all__ = ["carry_anchor", "carry_history", "carry_trees"]

SAME_SHARE = 0.5
"""Of the fruits of a row that hang on trees already: then the trees are known."""


def carry_history(
    connection: sqlite3.Connection, theirs: Besides, fruit_ids: Mapping[int, int], shared: Sequence[str]
) -> None:
    """Write what had changed there before; of sessions that are in both, this map tells itself.

    A fruit that is no more has an id of this map from now on, which nobody else gets.
    """
    kept = [(cause, session, change) for cause, session, change in theirs.history if session not in shared]
    last = last_ids(connection).get("fruits", 0)
    named = {one for _, _, change in kept for one in (change.from_fruit_id, change.to_fruit_id)}
    lost = sorted(named - fruit_ids.keys())
    now = {**fruit_ids, **{one: last + place for place, one in enumerate(lost, start=1)}}
    connection.execute("UPDATE sqlite_sequence SET seq = ? WHERE name = 'fruits'", (last + len(lost),))
    connection.executemany(
        """INSERT INTO changes (cause, session, event, from_fruit_id, to_fruit_id, n_observations)
        VALUES (?, ?, ?, ?, ?, ?)""",
        (
            (cause, session, change.event, now[change.from_fruit_id], now[change.to_fruit_id], change.n_observations)
            for cause, session, change in kept
        ),
    )


def carry_anchor(connection: sqlite3.Connection, theirs: Besides, map_from_other: NDArray[np.float64]) -> Iterator[str]:
    """Say where on Earth the map lies, by the other map where this one does not know; give what was left out."""
    if theirs.anchor is None or theirs.fit is None:
        return
    other_from_map = np.linalg.inv(map_from_other)
    ours = stored_anchor(connection)
    enu_from_map = theirs.anchor.enu_from_map @ other_from_map
    if ours is not None:
        here = map_from_other[None, :3, 3]
        there = replace(theirs.anchor, enu_from_map=enu_from_map)
        apart = ours.east_north_up(ours.geodetic(here)) - ours.east_north_up(there.geodetic(here))
        yield f"its place on Earth, {np.linalg.norm(apart[0, :2]):.2f} m from the one that the map has"
        return
    connection.execute(
        """INSERT INTO georeference (enu_from_map, longitude_deg, latitude_deg, height_m, source, n_points, rms_m)
        VALUES (?, ?, ?, ?, ?, ?, ?)""",
        (
            json.dumps(enu_from_map.tolist()), theirs.anchor.longitude_deg, theirs.anchor.latitude_deg,
            theirs.anchor.height_m, *theirs.fit,
        ),
    )  # fmt: skip
    places = geopackage.points_of([point[0] for point in theirs.control_points])
    moved = geopackage.points(moved_places(map_from_other, places))
    connection.executemany(
        f"INSERT INTO control_points ({', '.join(POINT_NAMES)}) VALUES ({', '.join('?' * len(POINT_NAMES))})",
        ((geom, *point[1:]) for geom, point in zip(moved, theirs.control_points, strict=True)),
    )


def carry_trees(
    connection: sqlite3.Connection,
    theirs: Besides,
    map_from_other: NDArray[np.float64],
    fruit_ids: Mapping[int, int],
) -> Iterator[str]:
    """Plant the rows of the other map where this one has no trees; give what was left out."""
    before = stored_trees(connection)
    bearing = dict(zip(*columns_of(connection, "fruits", ("id", "tree_id")), strict=True))
    standing = np.array([tree.place_in_map for tree in before]).reshape(-1, 3)
    names = {tree.name for tree in before}
    for row_id in sorted({tree.row_id for tree in theirs.trees}):
        trees = [
            replace(tree, place_in_map=moved_places(map_from_other, tree.place_in_map))
            for tree in theirs.trees
            if tree.row_id == row_id
        ]
        hanging = _hanging(theirs, trees, fruit_ids)
        row = theirs.rows.get(row_id)
        if _is_known(trees, hanging, bearing, standing):
            called = (row.name or f"row {row_id}") if row else "trees of no row"
            yield f"{called} with {amount(len(trees), 'tree')}: the map has trees there"
            continue
        now = _planted(connection, row, trees, names)
        free = {fruit: (now[tree], chance) for fruit, (tree, chance) in hanging.items() if bearing[fruit] is None}
        bear(
            connection,
            np.array([*free], np.int64),
            np.array([tree for tree, _ in free.values()], np.int64),
            np.array([chance for _, chance in free.values()]),
        )


def _hanging(
    theirs: Besides, trees: Sequence[StoredTree], fruit_ids: Mapping[int, int]
) -> dict[int, tuple[int, float]]:
    """Return their tree, and its probability, of the fruits of this map that hang on some of their trees."""
    own = {tree.tree_id for tree in trees}
    return {
        fruit_ids[fruit]: (tree, chance)
        for fruit, (tree, chance) in theirs.tree_of.items()
        if tree in own and fruit in fruit_ids
    }


def _is_known(
    trees: Sequence[StoredTree],
    hanging: Mapping[int, tuple[int, float]],
    bearing: Mapping[int, int | None],
    standing: NDArray[np.float64],
) -> bool:
    """Tell whether this map has trees where these stand: one is near one of them, or has most of its fruits."""
    n_fruits = Counter(tree for tree, _ in hanging.values())
    n_hang = Counter(tree for fruit, (tree, _) in hanging.items() if bearing[fruit] is not None)
    places = np.array([tree.place_in_map for tree in trees])
    distances_m = np.linalg.norm(places[:, None] - standing[None], axis=2)
    return bool((distances_m < NEAR_M).any()) or any(n_hang[tree] > SAME_SHARE * n for tree, n in n_fruits.items())


def _planted(
    connection: sqlite3.Connection, row: KnownRow | None, trees: Sequence[StoredTree], taken: set[str]
) -> dict[int, int]:
    """Write a row and its trees with ids of this map; return which tree has which."""
    row_id, number = _row(connection, row, trees) if row else (None, None)
    now = {}
    for tree in trees:
        is_default = row is not None and tree.name in (f"{row.number}-{tree.number}", *taken)
        name = f"{number}-{tree.number}" if is_default else tree.name
        cursor = connection.execute(
            """INSERT INTO trees (row_id, number, along_m, kind, n_fruits, geom, name, source)
            VALUES (?, ?, ?, ?, 0, ?, ?, ?)""",
            (
                row_id, tree.number, tree.along_m, tree.kind, geopackage.points([tree.place_in_map])[0], name,
                None if tree.source == DRAWN else tree.source,
            ),
        )  # fmt: skip
        now[tree.tree_id] = int(cursor.lastrowid or 0)
    return now


def _row(connection: sqlite3.Connection, row: KnownRow, trees: Sequence[StoredTree]) -> tuple[int, int]:
    """Write a row with the number that it had, or the next where that is taken; return its id and its number."""
    names, numbers = columns_of(connection, "rows", ("name", "number"))
    is_free = row.number is not None and row.number not in numbers
    number = row.number if is_free and row.number else 1 + max((one for one in numbers if one), default=0)
    is_own = row.name is not None and row.name != f"row {row.number}" and row.name not in names
    along = sorted(trees, key=lambda tree: (tree.number or 0, tree.tree_id))
    line = geopackage.line([tree.place_in_map for tree in along]) if len(along) > 1 else None
    cursor = connection.execute(
        "INSERT INTO rows (geom, source, spacing_m, spacing_log_odds, number, name) VALUES (?, ?, ?, ?, ?, ?)",
        (line, row.source, row.spacing_m, row.spacing_log_odds, number, row.name if is_own else f"row {number}"),
    )
    return int(cursor.lastrowid or 0), number
