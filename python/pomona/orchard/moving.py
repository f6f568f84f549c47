"""A session to another place in the map: its observations, its poses and the transform that says so."""

from __future__ import annotations

import json
import sqlite3

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.cloud import FruitCloud
from pomona.orchard.stored_sessions import cameras_in_map
from pomona.orchard.writing import covariance_cells, insert_poses, nullable
from pomona.store.cells import finite_json
from pomona.store.rows import columns_of
from pomona.trajectory import Trajectory

__all__ = ["move_session"]


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
