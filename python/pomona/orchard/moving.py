"""A session to another place in the map: its observations, poses and transform; trees go with it."""

from __future__ import annotations

import json
import sqlite3
from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.cloud import FruitCloud
from pomona.orchard.stored_sessions import cameras_in_map
from pomona.orchard.writing import covariance_cells, insert_poses, nullable
from pomona.store.cells import finite_json
from pomona.store.rows import columns_of
from pomona.trajectory import Trajectory

__all__ = ["JOINED_M", "move_session", "move_trees", "moved_places"]

JOINED_M = 0.5
"""Sessions whose fruits move farther came to another part of the map. By less they are laid better where they are, and
trees, which somebody may have measured, stay."""


def move_session(
    connection: sqlite3.Connection,
    session_id: int,
    map_from_session: NDArray[np.float64],
    cloud_in_map: FruitCloud,
    observation_ids: NDArray[np.int64],
) -> None:
    """Lay a session anew; `cloud_in_map` are its fruits where they are then, one for each observation."""
    sizes = np.full(len(cloud_in_map), np.nan) if cloud_in_map.diameters_m is None else cloud_in_map.diameters_m
    connection.executemany(
        """UPDATE observations SET geom = ?, diameter_m = ?, cxx = ?, cyy = ?, czz = ?, cxy = ?, cxz = ?, cyz = ?
        WHERE id = ?""",
        zip(
            geopackage.points(cloud_in_map.positions),
            nullable(sizes),
            *(nullable(column) for column in covariance_cells(cloud_in_map).T),
            observation_ids.tolist(),
            strict=True,
        ),
    )
    _move_poses(connection, session_id, map_from_session)
    connection.execute(
        "UPDATE sessions SET map_from_session = ? WHERE id = ?", (json.dumps(map_from_session.tolist()), session_id)
    )


def _move_poses(connection: sqlite3.Connection, session_id: int, map_from_session: NDArray[np.float64]) -> None:
    found = cameras_in_map(connection, session_id)
    if found is None:
        return
    ((before,),) = (columns_of(connection, "sessions", ("map_from_session",), f"WHERE sessions.id = {session_id:d}"),)
    frames, times_s, map_from_camera = found
    session_from_camera = np.linalg.inv(np.array(finite_json(before[0]), np.float64)) @ map_from_camera
    session_from_camera[:, :3, :3] /= np.cbrt(np.linalg.det(session_from_camera[:, :3, :3]))[:, None, None]
    connection.execute("DELETE FROM poses WHERE session_id = ?", (session_id,))
    insert_poses(connection, session_id, Trajectory(frames, times_s, session_from_camera), map_from_session)


def move_trees(connection: sqlite3.Connection, moves: Mapping[int, NDArray[np.float64]]) -> None:
    """Take trees, and the lines of their rows, along with the sessions that saw most of their fruits last.

    Parameters
    ----------
    connection
        The map, whose fruits still say which session saw them last before it moved.
    moves : mapping of int to (4, 4) float64
        Of sessions that came to another part: from where something was in the map to where it is.
    """
    if not moves:
        return
    tree_ids, row_ids, geoms = columns_of(connection, "trees", ("id", "row_id", "geom"))
    on_trees, seen_by = columns_of(connection, "fruits", ("tree_id", "last_session_id"), "WHERE tree_id NOTNULL")
    row_of = dict(zip(tree_ids, row_ids, strict=True))
    seen = Counter(zip(on_trees, seen_by, strict=True))
    of_tree = _most_of_each(seen)
    of_rows: Counter[tuple[int, int]] = Counter()
    for (tree_id, session_id), count in seen.items():
        of_rows[row_of.get(tree_id) or 0, session_id] += count
    of_row = _most_of_each(of_rows)
    for tree_id, row_id, geom in zip(tree_ids, row_ids, geoms, strict=True):
        # A tree on which nothing hangs goes with its row.
        move = moves.get(of_tree.get(tree_id, of_row.get(row_id or 0, 0)))
        if move is not None and geom is not None:
            place = moved_places(move, geopackage.points_of([geom]))
            connection.execute("UPDATE trees SET geom = ? WHERE id = ?", (geopackage.points(place)[0], tree_id))
    for row_id, geom in zip(*columns_of(connection, "rows", ("id", "geom")), strict=True):
        move, line = moves.get(of_row.get(row_id, 0)), None if geom is None else geopackage.line_of(geom)
        if move is not None and line is not None:
            connection.execute(
                "UPDATE rows SET geom = ? WHERE id = ?", (geopackage.line(moved_places(move, line)), row_id)
            )


def _most_of_each(counts: Mapping[tuple[int, int], int]) -> dict[int, int]:
    """Return the second with the largest count of each first; of several the smallest."""
    best: dict[int, int] = {}
    for (one, other), _ in sorted(counts.items(), key=lambda item: (-item[1], item[0])):
        best.setdefault(one, other)
    return best


def moved_places(move: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return places, (..., 3) metres, after a motion, (4, 4)."""
    return np.asarray(places @ move[:3, :3].T + move[:3, 3])
