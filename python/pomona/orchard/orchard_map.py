"""The map as a whole: what is in it, for people and for the verbs that follow."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.cloud import FruitCloud
from pomona.orchard import schema
from pomona.orchard.reading import fruits_in_map

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
        with schema.snapshot(self.path) as (_, kind):
            self.kind = kind

    def fruits(self) -> FruitCloud:
        """Return every fruit where it was last seen, with its identity as id."""
        with schema.snapshot(self.path) as (connection, _):
            return fruits_in_map(connection)

    def visits(self) -> tuple[Visit, ...]:
        """Return the sessions in order of date."""
        with schema.snapshot(self.path) as (connection, _):
            rows = connection.execute(
                """SELECT s.name, s.date, s.recording, s.map_from_session, count(o.id), count(o.match_probability),
                s.method, s.log_odds, s.noise_m FROM sessions s LEFT JOIN observations o ON o.session_id = s.id
                GROUP BY s.id ORDER BY s.date, s.id"""
            ).fetchall()
        return tuple(
            Visit(name, date, recording, np.array(json.loads(transform)), *about_match)
            for name, date, recording, transform, *about_match in rows
        )

    def observations(self) -> Observations:
        """Return what was seen of each fruit, in order of fruit and date."""
        with schema.snapshot(self.path) as (connection, _):
            rows = connection.execute(
                """SELECT o.fruit_id, s.name, o.label, o.geom, o.diameter_m, o.match_probability FROM observations o
                JOIN sessions s ON s.id = o.session_id ORDER BY o.fruit_id, s.date, s.id"""
            ).fetchall()
        fruit_ids, sessions, labels, geoms, diameters_m, probabilities = zip(*rows, strict=True) if rows else [()] * 6
        return Observations(
            fruit_ids=np.array(fruit_ids, dtype=np.int64),
            sessions=tuple(sessions),
            labels=tuple(labels),
            positions_in_map=geopackage.points_of(geoms),
            diameters_m=np.array(diameters_m, dtype=np.float64),
            probabilities=np.array(probabilities, dtype=np.float64),
        )
