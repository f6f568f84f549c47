"""Sessions and fruits out of the tables."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.cloud import FruitCloud, Unit, Views
from pomona.errors import PomonaError
from pomona.orchard import schema
from pomona.orchard.session import Session
from pomona.trajectory import Trajectory

__all__ = ["fruits_in_map", "load_session", "observed_cloud", "read_cloud", "read_session"]

COVARIANCE = "o.cxx, o.cxy, o.cxz, o.cxy, o.cyy, o.cyz, o.cxz, o.cyz, o.czz"


def read_cloud(path: Path) -> FruitCloud:
    """Read a session's fruits with the session's own ids, or a map's with theirs, each where it was last seen."""
    with schema.snapshot(path) as (connection, kind):
        if kind == "map":
            return fruits_in_map(connection)
        return observed_cloud(connection, _only_session(connection, path)[0])


def read_session(path: str | Path) -> Session:
    """Read a session file.

    Raises
    ------
    PomonaError
        When the file is not a session of ours: a map, another GeoPackage, a newer format.
    """
    path = Path(path)
    with schema.snapshot(path) as (connection, kind):
        if kind != "session":
            raise PomonaError(f"{path}: is a map, expected the file of one session")
        session_id, name, date, recording, configuration, input_hashes, program_version = _only_session(
            connection, path
        )
        return Session(
            name=name,
            date=date,
            recording=recording,
            cloud=observed_cloud(connection, session_id),
            trajectory=_trajectory(connection, session_id),
            configuration=json.loads(configuration),
            input_hashes=json.loads(input_hashes),
            program_version=program_version,
        )


def load_session(path: str | Path, *, date: str | None = None, unit: Unit = "m") -> Session:
    """Read a session file, or a bare cloud (.csv, .ply) as a session that is called as its file.

    Parameters
    ----------
    path : str or Path
        A session (.gpkg) or a cloud (.csv, .ply).
    date : str, optional
        ISO 8601 date of the visit; needed for a cloud, instead of the session's own otherwise.
    unit : {"m", "cm", "mm"}
        Unit of a cloud's coordinates.
    """
    path = Path(path)
    if path.suffix.lower() == ".gpkg":
        session = read_session(path)
        return session if date is None else replace(session, date=date)
    cloud = FruitCloud.read(path, unit=unit)
    if date is None:
        raise PomonaError(f"{path}: a bare cloud has no date, give the day of the visit: --date YYYY-MM-DD")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return Session(path.stem, date, path.name, cloud, input_hashes={path.name: digest})


def observed_cloud(connection: sqlite3.Connection, session_id: int) -> FruitCloud:
    """Return what a session saw, in the map's frame, with the session's ids, in the order of the session."""
    rows = connection.execute(
        f"""SELECT o.geom, o.label, o.diameter_m, o.n_views, o.other_columns, {COVARIANCE} FROM observations o
        WHERE o.session_id = ? ORDER BY o.id""",
        (session_id,),
    ).fetchall()
    geoms, labels, diameters_m, n_views, others, *cells = _columns(rows, 14)
    extras = [json.loads(other) for other in others] if others and None not in others else []
    return FruitCloud(
        positions=geopackage.points_of(geoms),
        ids=tuple(labels) if labels and None not in labels else None,
        diameters_m=_numbers(diameters_m),
        covariances=_covariances(cells),
        n_views=None if not n_views or None in n_views else np.array(n_views, dtype=np.int64),
        views=_views(connection, session_id),
        extras={name: tuple(row[name] for row in extras) for name in (extras[0] if extras else {})},
    )


def fruits_in_map(connection: sqlite3.Connection) -> FruitCloud:
    """Return every fruit where it was last seen, with the covariance of that sighting."""
    rows = connection.execute(
        f"""SELECT f.id, f.geom, f.diameter_m, f.state, f.last_seen, f.n_sessions, f.n_missed, {COVARIANCE}
        FROM fruits f
        LEFT JOIN observations o ON o.fruit_id = f.id AND o.session_id = f.last_session_id ORDER BY f.id"""
    ).fetchall()
    ids, geoms, diameters_m, states, last_seen, n_sessions, n_missed, *cells = _columns(rows, 16)
    return FruitCloud(
        positions=geopackage.points_of(geoms),
        ids=tuple(map(str, ids)),
        diameters_m=_numbers(diameters_m),
        covariances=_covariances(cells),
        extras={
            "state": tuple(states),
            "last_seen": tuple(last_seen),
            "n_sessions": tuple(map(str, n_sessions)),
            "n_missed": tuple(map(str, n_missed)),
        },
    )


def _only_session(connection: sqlite3.Connection, path: Path) -> tuple[Any, ...]:
    rows = connection.execute(
        "SELECT id, name, date, recording, configuration, input_hashes, program_version FROM sessions"
    ).fetchall()
    if len(rows) != 1:
        raise PomonaError(f"{path}: is a session file with {len(rows)} sessions, expected 1")
    return tuple(rows[0])


def _columns(rows: Sequence[Sequence[Any]], width: int) -> list[tuple[Any, ...]]:
    return list(zip(*rows, strict=True)) if rows else [()] * width


def _numbers(column: Sequence[float | None]) -> NDArray[np.float64] | None:
    """Return numbers with NaN for what is unknown; None when all of it is."""
    numbers = np.array(column, dtype=np.float64)
    return None if np.isnan(numbers).all() else numbers


def _covariances(cells: Sequence[Sequence[float | None]]) -> NDArray[np.float64] | None:
    numbers = np.array(cells, dtype=np.float64)
    return None if np.isnan(numbers).any() or not numbers.size else numbers.T.reshape(-1, 3, 3)


def _views(connection: sqlite3.Connection, session_id: int) -> Views | None:
    rows = connection.execute(
        """WITH seen AS (SELECT id, row_number() OVER (ORDER BY id) - 1 AS fruit FROM observations WHERE session_id = ?)
        SELECT frame, fruit FROM sightings JOIN seen ON seen.id = observation_id ORDER BY sightings.id""",
        (session_id,),
    ).fetchall()
    return Views(*np.array(rows, dtype=np.int64).T) if rows else None


def _trajectory(connection: sqlite3.Connection, session_id: int) -> Trajectory | None:
    from scipy.spatial.transform import Rotation

    rows = connection.execute(
        "SELECT geom, frame, time_s, qx, qy, qz, qw FROM poses WHERE session_id = ? ORDER BY id", (session_id,)
    ).fetchall()
    if not rows:
        return None
    geoms, frames, times_s, *quaternions = _columns(rows, 7)
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(np.array(quaternions).T).as_matrix()
    poses[:, :3, 3] = geopackage.points_of(geoms)
    return Trajectory(np.array(frames), np.array(times_s), poses)
