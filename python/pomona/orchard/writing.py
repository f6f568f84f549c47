"""Rows of a session into the tables; every function works inside the transaction that is open."""

from __future__ import annotations

import datetime
import json
import sqlite3
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.atomic import whole_file
from pomona.cloud import FruitCloud
from pomona.file_names import given_path, require_suffix
from pomona.fruit_crop import FruitCrop
from pomona.identity import VisitPair
from pomona.likes import Like, database_of
from pomona.orchard.earth_layers import write_earth_layers
from pomona.orchard.session import Session
from pomona.outputs import Output, require_outputs
from pomona.settings import Settings
from pomona.store import schema
from pomona.store.numbering import last_ids
from pomona.store.opening import blank
from pomona.store.values import iso_date
from pomona.trajectory import Trajectory

__all__ = [
    "Placement",
    "covariance_cells",
    "insert_crops",
    "insert_fruits",
    "insert_matches",
    "insert_observations",
    "insert_poses",
    "insert_session",
    "nullable",
    "update_layers",
    "write_session",
]

SESSION = Like("a session", lambda path: database_of(path) == "session")


@dataclass(frozen=True, eq=False)
class Placement:
    """How a session was found in the map: what `sessions` notes of the match."""

    settings: Settings
    log_odds: float
    noise_m: float

    def noted(self) -> tuple[str, str, float, float]:
        """Return the columns `method`, `settings`, `log_odds`, `noise_m`."""
        chosen = {**self.settings.call, "config": self.settings.overrides}
        return self.settings.call["method"], json.dumps(chosen, sort_keys=True), self.log_odds, self.noise_m


def write_session(
    path: str | Path,
    cloud: FruitCloud,
    *,
    name: str,
    date: str | datetime.date,
    recording: str,
    trajectory: Trajectory | None = None,
    configuration: Mapping[str, object] | None = None,
    input_hashes: Mapping[str, str] | None = None,
    crops: Mapping[int, FruitCrop] | None = None,
    force: bool = False,
) -> None:
    """Write one visit as a map with one session (GeoPackage); the file appears whole or not at all.

    Parameters
    ----------
    path : str or Path
        The .gpkg file; a session that is there is replaced, a map never.
    cloud : FruitCloud
        Fruits in the session's frame, metres; ids are the session's own names of the fruits.
    name : str
        Name of the session, used once in a map.
    date : str or datetime.date
        Local date or date and time, as text in ISO 8601, for example ``2021-09-27`` or ``2021-09-27T11:40:12``.
    recording : str
        Where the session came from.
    trajectory : Trajectory, optional
        Camera poses in the session's frame.
    configuration : mapping, optional
        Effective settings of the program that made the cloud, JSON values.
    input_hashes : mapping, optional
        File name to SHA-256 of the inputs.
    crops : mapping of int to FruitCrop, optional
        Small pictures of fruits, by row of the cloud.
    force : bool
        Replace another file too; never a map.

    Raises
    ------
    PomonaError
        When an argument is of another kind, the date is not one, the configuration is not JSON, the file has another
        suffix, is there and no session, or cannot be written.
    """
    target = given_path(path)
    require_suffix(target, (".gpkg",))
    session = Session(
        name,
        iso_date(date),
        recording,
        cloud,
        trajectory,
        {} if configuration is None else configuration,
        {} if input_hashes is None else input_hashes,
        crops={} if crops is None else crops,
    )
    require_outputs([Output(target, SESSION)], [], force=force, otherwise="force=True replaces it")
    with whole_file(target) as partial, blank(partial, target) as connection:
        schema.create(connection, "session")
        session_id = insert_session(connection, session, np.eye(4))
        fruit_ids = insert_fruits(connection, session_id, session.date, cloud)
        observation_ids = insert_observations(connection, session_id, fruit_ids, cloud)
        insert_crops(connection, session_id, observation_ids, session.crops)
        update_layers(connection)


def insert_session(
    connection: sqlite3.Connection,
    session: Session,
    map_from_session: NDArray[np.float64],
    placement: Placement | None = None,
    content_sha256: str | None = None,
) -> int:
    """Add the session, its provenance and its poses; return its number. Fruits follow.

    What it saw has the hash of `session`, unless it was seen before it came from another map.
    """
    cursor = connection.execute(
        """INSERT INTO sessions (name, date, recording, content_sha256, map_from_session, program_version,
        configuration, input_hashes, method, settings, log_odds, noise_m)
        VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)""",
        (
            session.name,
            session.date,
            session.recording,
            content_sha256 or session.content_sha256,
            json.dumps(map_from_session.tolist()),
            session.program_version,
            session.configuration_json,
            session.input_hashes_json,
            *((None,) * 4 if placement is None else placement.noted()),
        ),
    )
    session_id = int(cursor.lastrowid or 0)
    if session.trajectory is not None:
        insert_poses(connection, session_id, session.trajectory, map_from_session)
    return session_id


def insert_fruits(
    connection: sqlite3.Connection, session_id: int, date: str, cloud_in_map: FruitCloud
) -> NDArray[np.int64]:
    """Give new fruits their ids, (N,), in order of rows."""
    if not len(cloud_in_map):
        return np.empty(0, np.int64)
    last = last_ids(connection).get("fruits", 0)
    ids = np.arange(last + 1, last + 1 + len(cloud_in_map))
    connection.executemany(
        """INSERT INTO fruits (id, geom, state, last_seen, last_session_id, n_sessions, diameter_m)
        VALUES (?, ?, 'seen', ?, ?, 1, ?)""",
        (
            (fruit_id, geom, date, session_id, diameter_m)
            for fruit_id, geom, diameter_m in zip(
                ids.tolist(), geopackage.points(cloud_in_map.positions), _diameters(cloud_in_map), strict=True
            )
        ),
    )
    return ids


def insert_observations(
    connection: sqlite3.Connection,
    session_id: int,
    fruit_ids: NDArray[np.int64],
    cloud_in_map: FruitCloud,
) -> NDArray[np.int64]:
    """Add what the session saw of each fruit, one row of the cloud each; return their numbers, (N,)."""
    n = len(cloud_in_map)
    last = last_ids(connection).get("observations", 0)
    columns = zip(
        range(last + 1, last + 1 + n),
        geopackage.points(cloud_in_map.positions),
        fruit_ids.tolist(),
        cloud_in_map.ids or [None] * n,
        _diameters(cloud_in_map),
        *(nullable(column) for column in covariance_cells(cloud_in_map).T),
        [None] * n if cloud_in_map.n_views is None else cloud_in_map.n_views.tolist(),
        _other_columns(cloud_in_map),
        strict=True,
    )
    connection.executemany(
        f"""INSERT INTO observations (session_id, id, geom, fruit_id, label, diameter_m, cxx, cyy, czz, cxy, cxz, cyz,
        n_views, other_columns) VALUES ({session_id:d}{", ?" * 13})""",
        columns,
    )
    if cloud_in_map.views is not None:
        connection.executemany(
            "INSERT INTO sightings (observation_id, frame) VALUES (?, ?)",
            zip(
                (cloud_in_map.views.fruits + last + 1).tolist(),
                cloud_in_map.views.frames.tolist(),
                strict=True,
            ),
        )
    return np.arange(last + 1, last + 1 + n)


def insert_crops(
    connection: sqlite3.Connection, session_id: int, observation_ids: NDArray[np.int64], crops: Mapping[int, FruitCrop]
) -> None:
    """Add the small pictures of fruits; `crops` go by row of the session, as `observation_ids` do."""
    connection.executemany(
        "INSERT INTO crops (session_id, observation_id, frame, picture) VALUES (?, ?, ?, ?)",
        ((session_id, int(observation_ids[row]), crop.frame, crop.picture) for row, crop in sorted(crops.items())),
    )


def insert_matches(
    connection: sqlite3.Connection,
    pair: VisitPair,
    session_ids: tuple[int, int],
    observation_ids: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> None:
    """Note how two sessions match; `observation_ids` are those of their rows."""
    first, second = (ids[rows] for ids, rows in zip(observation_ids, pair.rows.T, strict=True))
    pairs = zip(first.tolist(), second.tolist(), pair.probabilities.tolist(), strict=True)
    connection.execute(
        """INSERT INTO matches (first_session_id, second_session_id, first_from_second, log_odds, pairs)
        VALUES (?, ?, ?, ?, ?)""",
        (*session_ids, json.dumps(pair.first_from_second.tolist()), pair.log_odds, json.dumps(list(pairs))),
    )


def covariance_cells(cloud: FruitCloud) -> NDArray[np.float64]:
    """Return the columns cxx, cyy, czz, cxy, cxz, cyz, (N, 6); NaN where unknown."""
    if cloud.covariances is None:
        return np.full((len(cloud), 6), np.nan)
    return cloud.covariances.reshape(len(cloud), 9)[:, [0, 4, 8, 1, 2, 5]]


def update_layers(connection: sqlite3.Connection, fruit_ids: Collection[int] | None = None) -> None:
    """Bring places on Earth, extents and times up to date, where only some fruits changed of these alone.

    The time is the newest visit's: the same input gives the same file.
    """
    write_earth_layers(connection, fruit_ids)
    (newest,) = connection.execute("SELECT max(date) FROM sessions").fetchone()
    day, _, time = newest.partition("T")
    for name in ("pomona_format", *(layer[0] for layer in (*schema.LAYERS, *schema.VIEWS))):
        geopackage.touch(connection, name, f"{day}T{time[:8] or '00:00:00'}.000Z")


def insert_poses(
    connection: sqlite3.Connection, session_id: int, trajectory: Trajectory, map_from_session: NDArray[np.float64]
) -> None:
    """Add the cameras of a session in the map's frame."""
    from scipy.spatial.transform import Rotation

    if not len(trajectory):
        return
    map_from_camera = map_from_session @ trajectory.session_from_camera
    # A reconstruction of unknown scale comes into the map by a similarity; the camera's axes keep their length.
    scale = np.cbrt(np.linalg.det(map_from_session[:3, :3]))
    quaternions = Rotation.from_matrix(map_from_camera[:, :3, :3] / scale).as_quat(canonical=True)
    connection.executemany(
        "INSERT INTO poses (session_id, geom, frame, time_s, qx, qy, qz, qw) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        (
            (session_id, geom, frame, time_s, *quaternion)
            for geom, frame, time_s, quaternion in zip(
                geopackage.points(map_from_camera[:, :3, 3]),
                trajectory.frames.tolist(),
                trajectory.times_s.tolist(),
                quaternions.tolist(),
                strict=True,
            )
        ),
    )


def nullable(column: NDArray[np.float64]) -> list[float | None]:
    """Return numbers for a column, null where they are NaN."""
    return [None if value != value else value for value in column.tolist()]


def _diameters(cloud: FruitCloud) -> list[float | None]:
    return [None] * len(cloud) if cloud.diameters_m is None else nullable(cloud.diameters_m)


def _other_columns(cloud: FruitCloud) -> list[str | None]:
    if not cloud.extras:
        return [None] * len(cloud)
    names = list(cloud.extras)
    return [json.dumps(dict(zip(names, row, strict=True))) for row in zip(*cloud.extras.values(), strict=True)]
