"""A session into the map: its fruits are recognised there, and get the identities that only the map gives out."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.atomic import NoLinksError, new_file
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.orchard.replay import in_view_unseen
from pomona.orchard.session import Session
from pomona.orchard.writing import Placement, insert_fruits, insert_observations, insert_session, update_layers
from pomona.settings import Settings
from pomona.store import schema
from pomona.store.failures import WrongContentError
from pomona.store.numbering import last_ids
from pomona.store.opening import TIMEOUT_S, Waiting, blank, writing
from pomona.store.rows import columns_of
from pomona.store.stored_fruits import fruits_in_map

if TYPE_CHECKING:
    from pomona.matching import Match

__all__ = ["Added", "add_session"]


@dataclass(frozen=True, eq=False)
class Added:
    """What became of a session.

    Attributes
    ----------
    fruit_ids : (N,) int64
        Identity of each fruit of the session; 0 for all when the session was not added.
    n_matched, n_new, n_missed : int
        Fruits known before, fruits of which the session is the first sight, fruits of the map that hang where the
        session looked and were not seen.
    match : Match, optional
        How the session was found in the map; None for the first session.
    """

    fruit_ids: NDArray[np.int64]
    n_matched: int
    n_new: int
    n_missed: int
    match: Match | None

    @property
    def is_added(self) -> bool:
        """Whether the map holds the session now."""
        return self.match is None or self.match.status.value == "Found"


def add_session(
    path: str | Path,
    session: Session,
    *,
    settings: Settings | None = None,
    timeout_s: float = TIMEOUT_S,
    waiting: Waiting | None = None,
) -> Added:
    """Recognise a session's fruits in the map and add it; the first session starts the map.

    All of it happens in one transaction: a crash, a full disk or a kill leaves the map as it was. When the session is
    not found in the map, nothing is written. A new map appears whole; when two programs start it at once, the second
    finds its session in the map of the first.

    Parameters
    ----------
    path : str or Path
        The map (.gpkg); it is made when it is not there.
    session : Session
        The visit to add.
    settings : Settings, optional
        How to match; the defaults of `pomona.match` otherwise.
    timeout_s : float
        How long to wait for another program that is writing to the map.
    waiting : callable, optional
        Called once when it has to wait.

    Raises
    ------
    PomonaError
        When the file is not a map of ours, holds the session already or cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".gpkg":
        raise PomonaError(f"{path}: found suffix {path.suffix!r}, expected .gpkg for a map")
    if not len(session.cloud):
        raise PomonaError(f"session {session.name}: has no fruits, expected at least one")
    if not path.exists():
        try:
            with new_file(path) as partial, blank(partial, path) as connection:
                return _start(connection, session)
        except FileExistsError:
            pass
        except NoLinksError:
            return _start_in_place(path, session, settings, timeout_s, waiting)
    return _add(path, session, settings, timeout_s, waiting)


def _start_in_place(
    path: Path, session: Session, settings: Settings | None, timeout_s: float, waiting: Waiting | None
) -> Added:
    """Start a map where it cannot appear whole: readers are told that it is empty until it is not."""
    try:
        return _add(path, session, settings, timeout_s, waiting, create=True)
    except BaseException:
        # SQLite makes the file before the first commit; a map that never was shall leave none.
        if path.exists() and path.stat().st_size == 0:
            path.unlink()
        raise


def _add(
    path: Path,
    session: Session,
    settings: Settings | None,
    timeout_s: float,
    waiting: Waiting | None,
    *,
    create: bool = False,
) -> Added:
    # A file of no bytes is what a killed start leaves where a map cannot appear whole.
    create = create or path.stat().st_size == 0
    with writing(path, "map", create=create, timeout_s=timeout_s, waiting=waiting) as (connection, is_blank):
        if is_blank:
            return _start(connection, session)
        last_ids(connection)
        _require_new(connection, session)
        settings = settings or Settings.load(None, {})
        known = fruits_in_map(connection, FruitCloud)
        if not len(known):
            raise WrongContentError("has sessions and no fruits, expected at least one")
        found = settings.match(session.cloud, known)
        if found.status.value != "Found":
            return Added(np.zeros(len(session.cloud), np.int64), 0, 0, 0, found)
        return _join(connection, session, known, found, settings)


def _start(connection: sqlite3.Connection, session: Session) -> Added:
    """Make the session's frame the map's, and each of its fruits a new one."""
    schema.create(connection, "map")
    session_id = insert_session(connection, session)
    fruit_ids = insert_fruits(connection, session_id, session.date, session.cloud)
    insert_observations(connection, session_id, fruit_ids, session.cloud)
    update_layers(connection)
    return Added(fruit_ids, 0, len(fruit_ids), 0, None)


def _join(
    connection: sqlite3.Connection, session: Session, known: FruitCloud, found: Match, settings: Settings
) -> Added:
    """Write the session: matched fruits keep their ids, the others get new ones, the map moves with the tree."""
    assert found.map_from_query is not None
    assert known.ids is not None
    cloud_in_map = session.cloud.transformed(found.map_from_query)
    known_ids = np.array(known.ids, dtype=np.int64)
    is_newest = _is_newest(connection, session.date)
    placement = Placement(found.map_from_query, settings, found.log_odds, found.noise_m)
    session_id = insert_session(connection, session, placement)
    rows, known_rows = found.pairs[:, 0], found.pairs[:, 1]
    is_new = np.isin(np.arange(len(cloud_in_map)), rows, invert=True)
    fruit_ids = np.zeros(len(cloud_in_map), dtype=np.int64)
    fruit_ids[rows] = known_ids[known_rows]
    fruit_ids[is_new] = insert_fruits(connection, session_id, session.date, cloud_in_map.select(is_new))
    probabilities, distances_m = np.full((2, len(cloud_in_map)), np.nan)
    probabilities[rows], distances_m[rows] = found.probabilities, found.distances_m
    insert_observations(connection, session_id, fruit_ids, cloud_in_map, probabilities, distances_m)

    _move_fruits(connection, session_id, session.date, cloud_in_map.select(rows), fruit_ids[rows])
    missed = in_view_unseen(known.positions, np.isin(np.arange(len(known)), known_rows))
    _count_misses(connection, known_ids[missed], is_newest=is_newest)
    update_layers(connection)
    return Added(fruit_ids, len(rows), int(is_new.sum()), len(missed), found)


def _require_new(connection: sqlite3.Connection, session: Session) -> None:
    """Refuse a session that is in the map: by its name, by what it saw or by what it was made from."""
    columns = columns_of(connection, "sessions", ("name", "content_sha256", "input_hashes"))
    if not columns[0]:
        raise WrongContentError("has no session, expected at least one")
    for name, content_sha256, input_hashes in zip(*columns, strict=True):
        if name == session.name:
            raise WrongContentError(f"session {name} is in the map already")
        if content_sha256 == session.content_sha256:
            raise WrongContentError(f"session {session.name} is in the map already, as {name}: the same fruits")
        if session.input_hashes and input_hashes == session.input_hashes_json:
            raise WrongContentError(f"session {session.name} is in the map already, as {name}: the same input files")


def _is_newest(connection: sqlite3.Connection, date: str) -> bool:
    (dates,) = columns_of(connection, "sessions", ("date",))
    return bool(date >= max(dates))


def _move_fruits(
    connection: sqlite3.Connection, session_id: int, date: str, matched_in_map: FruitCloud, fruit_ids: NDArray[np.int64]
) -> None:
    """Put matched fruits where the session saw them, unless a later visit has seen them since."""
    ids = fruit_ids.tolist()
    connection.executemany("UPDATE fruits SET n_sessions = n_sessions + 1 WHERE id = ?", ((i,) for i in ids))
    diameters_m = matched_in_map.diameters_m
    sizes = [None] * len(ids) if diameters_m is None else [d if d == d else None for d in diameters_m.tolist()]
    connection.executemany(
        """UPDATE fruits SET geom = ?, state = 'seen', last_seen = ?, last_session_id = ?,
        diameter_m = coalesce(?, diameter_m) WHERE id = ? AND last_seen <= ?""",
        (
            (geom, date, session_id, size, fruit_id, date)
            for geom, size, fruit_id in zip(geopackage.points(matched_in_map.positions), sizes, ids, strict=True)
        ),
    )


def _count_misses(connection: sqlite3.Connection, fruit_ids: NDArray[np.int64], *, is_newest: bool) -> None:
    """Count a miss; the state is that of the newest visit."""
    connection.executemany(
        "UPDATE fruits SET n_missed = n_missed + 1, state = CASE WHEN ? THEN 'missed' ELSE state END WHERE id = ?",
        ((is_newest, fruit_id) for fruit_id in fruit_ids.tolist()),
    )
