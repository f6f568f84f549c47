"""Sessions and fruits out of the tables."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.cloud import FruitCloud, Views
from pomona.errors import PomonaError
from pomona.orchard.cells import finite_json
from pomona.orchard.failures import WrongContentError, content
from pomona.orchard.opening import snapshot
from pomona.orchard.rows import columns_of
from pomona.orchard.session import Session
from pomona.trajectory import Trajectory

__all__ = ["fruits_in_map", "observed_cloud", "read_cloud", "read_session"]

COVARIANCE = ("cxx", "cxy", "cxz", "cxy", "cyy", "cyz", "cxz", "cyz", "czz")

OF_SESSION = "WHERE session_id = {:d} ORDER BY id"

AT_LAST = "JOIN fruits f ON f.id = fruit_id AND f.last_session_id = session_id ORDER BY fruit_id"
"""The observation of each fruit by the session that saw it last."""


def read_cloud(path: Path) -> FruitCloud:
    """Read a session's fruits with the session's own ids, or a map's with theirs, each where it was last seen."""
    with snapshot(path) as (connection, kind):
        if kind == "map":
            return fruits_in_map(connection)
        return observed_cloud(connection, _only_session(connection)["id"])


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
        about = _only_session(connection)
        session_id = about.pop("id")
        cloud, trajectory = observed_cloud(connection, session_id), _trajectory(connection, session_id)
        with content("sessions"):
            return Session(cloud=cloud, trajectory=trajectory, **about)


def observed_cloud(connection: sqlite3.Connection, session_id: int) -> FruitCloud:
    """Return what a session saw, in the map's frame, with the session's ids, in the order of the session."""
    ids, geoms, labels, diameters_m, n_views, others, *cells = columns_of(
        connection,
        "observations",
        ("id", "geom", "label", "diameter_m", "n_views", "other_columns", *COVARIANCE),
        OF_SESSION.format(session_id),
    )
    with content("observations"):
        return FruitCloud(
            positions=geopackage.points_of(geoms),
            ids=tuple(labels) if labels and None not in labels else None,
            diameters_m=_numbers(diameters_m),
            covariances=_covariances(cells),
            n_views=None if not n_views or None in n_views else np.array(n_views, dtype=np.int64),
            views=_views(connection, session_id, np.array(ids, dtype=np.int64)),
            extras=_extras(ids, others),
        )


def fruits_in_map(connection: sqlite3.Connection) -> FruitCloud:
    """Return every fruit where it was last seen, with the covariance of that sighting."""
    names = ("id", "geom", "diameter_m", "state", "last_seen", "last_session_id", "n_sessions", "n_missed")
    ids, geoms, diameters_m, states, last_seen, last_session_ids, n_sessions, n_missed = columns_of(
        connection, "fruits", names
    )
    seen_ids, *cells = columns_of(connection, "observations", ("fruit_id", *COVARIANCE), AT_LAST)
    _require_seen(ids, last_session_ids, seen_ids)
    with content("fruits"):
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


def _require_seen(ids: Sequence[int], last_session_ids: Sequence[int], seen_ids: Sequence[int]) -> None:
    """Refuse fruits that their last session did not see, or saw twice."""
    if ids == seen_ids:
        return
    counts = dict(zip(*np.unique(seen_ids, return_counts=True), strict=True))
    for fruit_id, session_id in zip(ids, last_session_ids, strict=True):
        if counts.get(fruit_id) != 1:
            found = f"{counts.get(fruit_id, 'no')} observations of it by its last session {session_id}"
            raise WrongContentError(f"fruits {fruit_id}: found {found}, expected one")
    raise WrongContentError("fruits: an id is there twice, expected each once")


def _only_session(connection: sqlite3.Connection) -> dict[str, Any]:
    """Return the number of the session, and what `Session` is told besides the cloud and the trajectory."""
    names = ("id", "name", "date", "recording", "configuration", "input_hashes", "program_version")
    columns = columns_of(connection, "sessions", names)
    if len(columns[0]) != 1:
        raise WrongContentError(f"is a session file with {len(columns[0])} sessions, expected 1")
    about = {name: cells[0] for name, cells in zip(names, columns, strict=True)}
    parsed = {name: finite_json(about[name]) for name in ("configuration", "input_hashes")}
    return {**about, **parsed}


def _numbers(column: Sequence[float | None]) -> NDArray[np.float64] | None:
    """Return numbers with NaN for what is unknown; None when all of it is."""
    numbers = np.array(column, dtype=np.float64)
    return None if np.isnan(numbers).all() else numbers


def _covariances(cells: Sequence[Sequence[float | None]]) -> NDArray[np.float64] | None:
    numbers = np.array(cells, dtype=np.float64)
    return None if np.isnan(numbers).any() or not numbers.size else numbers.T.reshape(-1, 3, 3)


def _extras(ids: Sequence[int], others: Sequence[str | None]) -> dict[str, tuple[str, ...]]:
    rows = [finite_json(other) for other in others if other is not None]
    if not rows or None in others:
        return {}
    for observation_id, row in zip(ids, rows, strict=True):
        if row.keys() != rows[0].keys():
            raise WrongContentError(
                f"observations {observation_id}: other_columns: found {', '.join(row)[:60]!r}, "
                f"expected {', '.join(rows[0])[:60]!r} as in the session's first"
            )
    return {name: tuple(row[name] for row in rows) for name in rows[0]}


def _views(connection: sqlite3.Connection, session_id: int, ids: NDArray[np.int64]) -> Views | None:
    """Return the sightings of observations, numbered by their rows in `ids`, (N,) ascending."""
    of_session = (
        f"JOIN observations o ON o.id = observation_id WHERE o.session_id = {session_id:d} ORDER BY sightings.id"
    )
    observation_ids, frames = columns_of(connection, "sightings", ("observation_id", "frame"), of_session)
    if not frames:
        return None
    return Views(np.array(frames, dtype=np.int64), np.searchsorted(ids, observation_ids).astype(np.int64))


def _trajectory(connection: sqlite3.Connection, session_id: int) -> Trajectory | None:
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
    with content("poses"):
        return Trajectory(np.array(frames), np.array(times_s), poses)


def _require_units(ids: Sequence[int], quaternions: NDArray[np.float64]) -> None:
    lengths = np.linalg.norm(quaternions, axis=1)
    wrong = np.abs(lengths - 1) > 1e-6
    if wrong.any():
        row = int(np.argmax(wrong))
        raise WrongContentError(f"poses {ids[row]}: found a quaternion of length {lengths[row]:.3g}, expected 1")
