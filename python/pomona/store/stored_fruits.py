"""Fruits out of the tables; the caller says what to make of them, so that clouds can be read from here."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.errors import PomonaError
from pomona.store.cells import finite_json, places_of
from pomona.store.failures import WrongContentError, content
from pomona.store.opening import snapshot
from pomona.store.rows import columns_of, one_of
from pomona.store.values import is_scale_free
from pomona.views import Views

if TYPE_CHECKING:
    from pomona.cloud.fruit_cloud import FruitCloud

__all__ = [
    "OF_SESSION",
    "SeenBySession",
    "fruit_places",
    "fruits_in_map",
    "observed_cloud",
    "only_session",
    "seen_by_sessions",
    "session_row",
    "stored_cloud",
]

Made = TypeVar("Made", bound="FruitCloud")

COVARIANCE = ("cxx", "cxy", "cxz", "cxy", "cyy", "cyz", "cxz", "cyz", "czz")

UPPER, FROM_UPPER = ("cxx", "cyy", "czz", "cxy", "cxz", "cyz"), (0, 3, 4, 3, 1, 5, 4, 5, 2)
"""A covariance without what is there twice, and each cell of it among these."""

OF_SESSION = "WHERE session_id = {:d} ORDER BY id"

PROBABILITIES = ("state_probability", "fruit_probability")

AT_LAST = "JOIN fruits f ON f.id = fruit_id AND f.last_session_id = session_id{} ORDER BY fruit_id"
"""The observation of each fruit by the session that saw it last."""


@dataclass(frozen=True, eq=False)
class SeenBySession:
    """What a session saw, as the tables hold it.

    Attributes
    ----------
    session_id : int
    cloud : FruitCloud
        In the map's frame, in the order of the session.
    observation_ids, fruit_ids : (N,) int64
    match_probabilities, match_distances_m : (N,) float64
        NaN where the map says nothing.
    """

    session_id: int
    cloud: FruitCloud
    observation_ids: NDArray[np.int64]
    fruit_ids: NDArray[np.int64]
    match_probabilities: NDArray[np.float64]
    match_distances_m: NDArray[np.float64]


def stored_cloud(path: Path, make: type[FruitCloud], *, in_metres: bool = True) -> FruitCloud:
    """Read a session's fruits with the session's own ids, or a map's with theirs, each where it was last seen.

    A session without a scale is refused where metres are asked for.
    """
    with snapshot(path) as (connection, kind):
        if kind == "map":
            return fruits_in_map(connection, make)
        about = only_session(connection)
        if in_metres and is_scale_free(about["configuration"]):
            raise PomonaError(
                f"{path}: was triangulated without a scale, expected metres: only a match with --scale free takes it"
            )
        return observed_cloud(connection, about["id"], make)


def observed_cloud(connection: sqlite3.Connection, session_id: int, make: type[FruitCloud]) -> FruitCloud:
    """Return what a session saw, in the map's frame, with the session's ids, in the order of the session."""
    ids, geoms, labels, diameters_m, n_views, others, *cells = columns_of(
        connection,
        "observations",
        ("id", "geom", "label", "diameter_m", "n_views", "other_columns", *COVARIANCE),
        OF_SESSION.format(session_id),
    )
    with content("observations"):
        return make(
            positions=geopackage.points_of(geoms),
            # Earlier versions took an empty name from Python and PLY.
            ids=tuple(labels) if labels and all(labels) else None,
            diameters_m=_numbers(diameters_m),
            covariances=_covariances(cells),
            n_views=None if not n_views or None in n_views else np.array(n_views, dtype=np.int64),
            views=_views(connection, session_id, np.array(ids, dtype=np.int64)),
            extras=_extras(ids, others),
        )


def seen_by_sessions(
    connection: sqlite3.Connection, session_ids: Collection[int], make: type[FruitCloud]
) -> dict[int, SeenBySession]:
    """Return where sessions saw their fruits and how large, and which these are; not what they noted besides.

    All of them in one question: what a part of a map holds is read at once.
    """
    names = ("session_id", "id", "fruit_id", "geom", "n_views", "diameter_m", "match_probability", "match_distance_m")
    sessions, ids, fruit_ids, geoms, n_views, *cells = columns_of(
        connection, "observations", (*names, *UPPER), one_of("session_id", session_ids)
    )
    whole = np.array([sessions, ids, fruit_ids], np.int64)
    places, numbers = geopackage.points_of(geoms), np.array(cells, np.float64)
    seen = {}
    for session_id in session_ids:
        rows = np.flatnonzero(whole[0] == session_id)
        diameters_m, probabilities, distances_m, *upper = numbers[:, rows]
        views = [n_views[row] for row in rows.tolist()]
        with content("observations"):
            cloud = make(
                positions=places[rows],
                diameters_m=_numbers(diameters_m),
                covariances=_covariances([upper[at] for at in FROM_UPPER]),
                n_views=None if not views or None in views else np.array(views, np.int64),
            )
        seen[session_id] = SeenBySession(session_id, cloud, whole[1, rows], whole[2, rows], probabilities, distances_m)
    return seen


def fruits_in_map(
    connection: sqlite3.Connection, make: Callable[..., Made], fruit_ids: Collection[int] | None = None
) -> Made:
    """Return every fruit, or those of these ids, where it was last seen, with the covariance of that sighting."""
    which, at_last = "", AT_LAST.format("")
    if fruit_ids is not None:
        listed = ", ".join(map(str, fruit_ids))
        which, at_last = one_of("fruits.id", fruit_ids), AT_LAST.format(f" AND f.id IN ({listed})")
    names = ("id", "geom", "diameter_m", "state", "last_seen", "last_session_id", "n_sessions", "n_missed", "tree_id")
    ids, geoms, diameters_m, states, last_seen, last_session_ids, n_sessions, n_missed, of_fruits, *probabilities = (
        columns_of(connection, "fruits", (*names, *PROBABILITIES), which)
    )
    seen_ids, *cells = columns_of(connection, "observations", ("fruit_id", *COVARIANCE), at_last)
    _require_seen(ids, last_session_ids, seen_ids)
    with content("fruits"):
        return make(
            positions=geopackage.points_of(geoms),
            ids=tuple(map(str, ids)),
            diameters_m=_numbers(diameters_m),
            covariances=_covariances(cells),
            extras={
                "state": tuple(states),
                "last_seen": tuple(last_seen),
                "n_sessions": tuple(map(str, n_sessions)),
                "n_missed": tuple(map(str, n_missed)),
                **{name: _shares(cells) for name, cells in zip(PROBABILITIES, probabilities, strict=True)},
                **_trees(connection, of_fruits),
            },
        )


def fruit_places(connection: sqlite3.Connection, which: str = "") -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return ids, (N,), and places, (N, 3), of the fruits that `which` chooses as for `columns_of`, by their ids.

    A map may have a hundred thousand: they come in one text, not in as many rows. Where a cell is wrong, `columns_of`
    says which.
    """
    ids, points = connection.execute(
        f"SELECT group_concat(fruits.id), group_concat(hex(geom), '') FROM fruits {which}"
    ).fetchone()
    if ids is not None:
        numbers, places = np.fromstring(ids, np.int64, sep=","), places_of(bytes.fromhex(points or ""))
        if places is not None and len(places) == len(numbers):
            order = np.argsort(numbers)
            return numbers[order], places[order]
    listed, geoms = columns_of(connection, "fruits", ("id", "geom"), which)
    return np.array(listed, np.int64), geopackage.points_of(geoms)


def _trees(connection: sqlite3.Connection, of_fruits: Sequence[int | None]) -> dict[str, tuple[str, ...]]:
    """Return the column `tree`, blank for the fruits of none, and `row` where the map has several rows of trees.

    Nothing where the map has told these fruits no trees.
    """
    if not any(of_fruits):
        return {}
    ids, names, row_ids = columns_of(connection, "trees", ("id", "name", "row_id"))
    tree_named, row_of = dict(zip(ids, names, strict=True)), dict(zip(ids, row_ids, strict=True))
    found = {"tree": tuple("" if tree is None else tree_named.get(tree) or f"tree {tree}" for tree in of_fruits)}
    if len({row for row in row_ids if row is not None}) < 2:
        return found
    row_named = dict(zip(*columns_of(connection, "rows", ("id", "name")), strict=True))
    of_rows = [row_of.get(tree) for tree in of_fruits]
    return {**found, "row": tuple("" if row is None else row_named.get(row) or f"row {row}" for row in of_rows)}


def only_session(connection: sqlite3.Connection) -> dict[str, Any]:
    """Return the number of the session, and what `Session` is told besides the cloud and the trajectory."""
    (ids,) = columns_of(connection, "sessions", ("id",))
    if len(ids) != 1:
        raise WrongContentError(f"is a session file with {len(ids)} sessions, expected 1")
    return {"id": ids[0], **session_row(connection, ids[0])}


def session_row(connection: sqlite3.Connection, session_id: int) -> dict[str, Any]:
    """Return what `Session` is told besides the cloud and the trajectory."""
    names = ("name", "date", "recording", "configuration", "input_hashes", "program_version")
    columns = columns_of(connection, "sessions", names, one_of("sessions.id", [session_id]))
    about = {name: cells[0] for name, cells in zip(names, columns, strict=True)}
    parsed = {name: finite_json(about[name]) for name in ("configuration", "input_hashes")}
    return {**about, **parsed}


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


def _numbers(column: Sequence[float | None] | NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return numbers with NaN for what is unknown; None when all of it is."""
    numbers = np.array(column, dtype=np.float64)
    return None if np.isnan(numbers).all() else numbers


def _shares(column: Sequence[float | None]) -> tuple[str, ...]:
    return tuple("" if cell is None else f"{cell:.4f}" for cell in column)


def _covariances(cells: Sequence[Sequence[float | None] | NDArray[np.float64]]) -> NDArray[np.float64] | None:
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
