"""The map as a whole: what is in it, for people and for the verbs that follow."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.cloud import FruitCloud
from pomona.orchard.cells import finite_json
from pomona.orchard.opening import snapshot
from pomona.orchard.reading import fruits_in_map
from pomona.orchard.rows import columns_of

__all__ = ["Observations", "OrchardMap", "Visit"]


@dataclass(frozen=True, eq=False)
class Visit:
    """One session as the map knows it.

    Attributes
    ----------
    name, date, recording : str
        As in `Session`.
    map_from_session : (4, 4) float64
        Rigid transform into the map.
    n_fruits, n_matched : int
        Fruits the session saw, and how many of them the map knew.
    method : str or None
        How it was matched; None for the first.
    log_odds, noise_m : float or None
        Evidence and noise of the match.
    """

    name: str
    date: str
    recording: str
    map_from_session: NDArray[np.float64]
    n_fruits: int
    n_matched: int
    method: str | None
    log_odds: float | None
    noise_m: float | None


@dataclass(frozen=True, eq=False)
class Observations:
    """What all sessions saw of all fruits, (K,) rows in order of fruit and date.

    Attributes
    ----------
    fruit_ids : (K,) int64
        Identity in the map.
    sessions : tuple of K str
        Name of the session.
    labels : tuple of K str or None
        The session's own name of the fruit.
    positions_in_map : (K, 3) float64
        Metres.
    diameters_m : (K,) float64
        NaN where unknown.
    probabilities : (K,) float64
        Of the match; NaN where the session was the first to see the fruit.
    """

    fruit_ids: NDArray[np.int64]
    sessions: tuple[str, ...]
    labels: tuple[str | None, ...]
    positions_in_map: NDArray[np.float64]
    diameters_m: NDArray[np.float64]
    probabilities: NDArray[np.float64]


class OrchardMap:
    """A map or session file for reading; every call sees the file as it is at that moment.

    Parameters
    ----------
    path : str or Path
        The .gpkg file.

    Raises
    ------
    PomonaError
        When the file is not ours or from a newer program.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        with snapshot(self.path) as (_, kind):
            self.kind = kind

    def fruits(self) -> FruitCloud:
        """Return every fruit where it was last seen, with its identity as id."""
        with snapshot(self.path) as (connection, _):
            return fruits_in_map(connection)

    def visits(self) -> tuple[Visit, ...]:
        """Return the sessions in order of date."""
        names = ("id", "name", "date", "recording", "map_from_session", "method", "log_odds", "noise_m")
        with snapshot(self.path) as (connection, _):
            rows = zip(*columns_of(connection, "sessions", names, "ORDER BY date, id"), strict=True)
            seen_by, probabilities = columns_of(connection, "observations", ("session_id", "match_probability"))
        n_fruits = Counter(seen_by)
        n_matched = Counter(
            by for by, probability in zip(seen_by, probabilities, strict=True) if probability is not None
        )
        return tuple(
            Visit(name, date, recording, np.array(finite_json(transform)), n_fruits[i], n_matched[i], *about_match)
            for i, name, date, recording, transform, *about_match in rows
        )

    def observations(self) -> Observations:
        """Return what was seen of each fruit, in order of fruit and date."""
        names = ("fruit_id", "session_id", "label", "geom", "diameter_m", "match_probability")
        in_order = "JOIN sessions s ON s.id = session_id ORDER BY fruit_id, s.date, s.id"
        with snapshot(self.path) as (connection, _):
            sessions = dict(zip(*columns_of(connection, "sessions", ("id", "name")), strict=True))
            fruit_ids, seen_by, labels, geoms, *numbers = columns_of(connection, "observations", names, in_order)
        diameters_m, probabilities = (np.array(column, dtype=np.float64) for column in numbers)
        return Observations(
            fruit_ids=np.array(fruit_ids, dtype=np.int64),
            sessions=tuple(sessions[session_id] for session_id in seen_by),
            labels=tuple(labels),
            positions_in_map=geopackage.points_of(geoms),
            diameters_m=diameters_m,
            probabilities=probabilities,
        )
