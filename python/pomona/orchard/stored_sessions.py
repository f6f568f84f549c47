"""Sessions out of the tables."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.fruit_crop import FruitCrop
from pomona.orchard.crops import crops_of_session
from pomona.orchard.session import Session
from pomona.store.failures import WrongContentError, content
from pomona.store.opening import snapshot
from pomona.store.rows import columns_of
from pomona.store.stored_fruits import OF_SESSION, observed_cloud, only_session, session_row
from pomona.trajectory import Trajectory

__all__ = ["cameras_in_map", "read_session", "session_in_map"]


def read_session(path: str | Path) -> Session:
    """Read a session file.

    Raises
    ------
    PomonaError
        When the file is not a session of ours: a map, another GeoPackage, a newer format, or edited to what cannot be.
    """
    path = Path(path)
    with snapshot(path) as (connection, kind):
        if kind != "session":
            raise PomonaError(f"{path}: is a map, expected the file of one session")
        about = only_session(connection)
        session_id = about.pop("id")
        cloud, trajectory = observed_cloud(connection, session_id, FruitCloud), _trajectory(connection, session_id)
        crops = _crops_by_row(connection, session_id)
        with content("sessions"):
            return Session(cloud=cloud, trajectory=trajectory, crops=crops, **about)


def _crops_by_row(connection: sqlite3.Connection, session_id: int) -> dict[int, FruitCrop]:
    """Return the small pictures of a session's fruits by their rows in its cloud."""
    (ids,) = columns_of(connection, "observations", ("id",), OF_SESSION.format(session_id))
    row_of = {observation_id: row for row, observation_id in enumerate(ids)}
    crops = crops_of_session(connection, session_id)
    strange = next((seen for seen in crops if seen not in row_of), None)
    if strange is not None:
        raise WrongContentError(f"crops: observation_id: found {strange}, expected an observation of its session")
    return {row_of[seen]: crop for seen, crop in crops.items()}


def session_in_map(connection: sqlite3.Connection, session_id: int, session_from_map: NDArray[np.float64]) -> Session:
    """Return a session of a map, in its own frame again."""
    about = session_row(connection, session_id)
    cloud = observed_cloud(connection, session_id, FruitCloud).transformed(session_from_map)
    found = cameras_in_map(connection, session_id)
    trajectory = None
    if found is not None:
        frames, times_s, map_from_camera = found
        session_from_camera = session_from_map @ map_from_camera
        session_from_camera[:, :3, :3] /= np.cbrt(np.linalg.det(session_from_camera[:, :3, :3]))[:, None, None]
        trajectory = Trajectory(frames, times_s, session_from_camera)
    crops = _crops_by_row(connection, session_id)
    with content("sessions"):
        return Session(cloud=cloud, trajectory=trajectory, crops=crops, **about)


def _trajectory(connection: sqlite3.Connection, session_id: int) -> Trajectory | None:
    found = cameras_in_map(connection, session_id)
    if found is None:
        return None
    with content("poses"):
        return Trajectory(*found)


def cameras_in_map(
    connection: sqlite3.Connection, session_id: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]] | None:
    """Return frames, (F,), times in seconds, (F,), and `map_from_camera`, (F, 4, 4), of a session that has them."""
    from scipy.spatial.transform import Rotation

    names = ("id", "geom", "frame", "time_s", "qx", "qy", "qz", "qw")
    ids, geoms, frames, times_s, *cells = columns_of(connection, "poses", names, OF_SESSION.format(session_id))
    if not ids:
        return None
    quaternions = np.array(cells).T
    _require_units(ids, quaternions)
    poses = np.tile(np.eye(4), (len(ids), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(quaternions).as_matrix()
    poses[:, :3, 3] = geopackage.points_of(geoms)
    return np.array(frames, np.int64), np.array(times_s, np.float64), poses


def _require_units(ids: Sequence[int], quaternions: NDArray[np.float64]) -> None:
    lengths = np.linalg.norm(quaternions, axis=1)
    wrong = np.abs(lengths - 1) > 1e-6
    if wrong.any():
        row = int(np.argmax(wrong))
        raise WrongContentError(f"poses {ids[row]}: found a quaternion of length {lengths[row]:.3g}, expected 1")
