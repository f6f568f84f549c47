"""The map as a whole: what is in it, for people and for the verbs that follow."""

from __future__ import annotations

import sqlite3
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pomona import geopackage
from pomona.amounts import amount
from pomona.cards import as_table
from pomona.cloud import FruitCloud
from pomona.earth import Anchor
from pomona.orchard.camera_ways import camera_ways
from pomona.orchard.earth_layers import stored_anchor
from pomona.orchard.fruit_ids import Change
from pomona.orchard.parts import part_numbers, parts_of_fruits
from pomona.store.cells import finite_json
from pomona.store.failures import told
from pomona.store.opening import snapshot
from pomona.store.rows import columns_of, one_of
from pomona.store.stored_fruits import fruits_in_map

__all__ = ["FruitsInMap", "Observations", "OrchardMap", "Visit"]

COUNTS = "SELECT session_id, count(*), count(match_probability) FROM observations GROUP BY session_id"
"""What each session saw, and of how much a visit before had seen it."""


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
        Fruits the session saw, and how many of them a visit before had seen.
    method : str or None
        How it was matched; None for the first.
    log_odds, noise_m : float or None
        Evidence and noise of the match.
    part : int
        Number of the part of the map that it is of, from 1; most maps have one.
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
    part: int = 1


@dataclass(frozen=True, eq=False, repr=False)
class Observations:
    """What all sessions saw of all fruits, (K,) rows in order of fruit and date.

    Attributes
    ----------
    fruit_ids : (K,) int64
        Identity in the map.
    sessions, dates : tuple of K str
        Name and date of the session.
    labels : tuple of K str or None
        The session's own name of the fruit.
    positions_in_map : (K, 3) float64
        Metres.
    diameters_m : (K,) float64
        NaN where unknown.
    probabilities : (K,) float64
        That it is this fruit; NaN for the first sight of the fruit.
    """

    fruit_ids: NDArray[np.int64]
    sessions: tuple[str, ...]
    dates: tuple[str, ...]
    labels: tuple[str | None, ...]
    positions_in_map: NDArray[np.float64]
    diameters_m: NDArray[np.float64]
    probabilities: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.fruit_ids)

    def __repr__(self) -> str:
        n_fruits, n_sessions = len(set(self.fruit_ids.tolist())), len(set(self.sessions))
        return f"Observations({len(self)} of {amount(n_fruits, 'fruit')} in {amount(n_sessions, 'session')})"

    def of_sessions(self, names: Container[str]) -> Observations:
        """Return what these sessions saw."""
        rows = [row for row, name in enumerate(self.sessions) if name in names]
        return Observations(
            fruit_ids=self.fruit_ids[rows],
            sessions=tuple(self.sessions[row] for row in rows),
            dates=tuple(self.dates[row] for row in rows),
            labels=tuple(self.labels[row] for row in rows),
            positions_in_map=self.positions_in_map[rows],
            diameters_m=self.diameters_m[rows],
            probabilities=self.probabilities[rows],
        )

    def columns(self) -> dict[str, Any]:
        """Return them as a long table: fruit, session, date, label, x, y, z, diameter_m, probability."""
        return {
            "fruit": self.fruit_ids,
            "session": self.sessions,
            "date": self.dates,
            "label": self.labels,
            **dict(zip("xyz", self.positions_in_map.T, strict=True)),
            "diameter_m": self.diameters_m,
            "probability": self.probabilities,
        }

    def cloud(self) -> FruitCloud:
        """Return them as a cloud, one row an observation; what they say besides place and size is in `extras`."""
        unknown = np.isnan(self.probabilities)
        return FruitCloud(
            positions=self.positions_in_map,
            diameters_m=self.diameters_m,
            extras={
                "fruit": tuple(map(str, self.fruit_ids.tolist())),
                "session": self.sessions,
                "date": self.dates,
                "label": tuple(label or "" for label in self.labels),
                "probability": tuple(
                    "" if none else f"{number:.6f}" for number, none in zip(self.probabilities, unknown, strict=True)
                ),
            },
        )

    def to_pandas(self) -> Any:
        """Return `columns` as a `pandas.DataFrame`; `PomonaError` when pandas is not installed."""
        from pomona.data_frames import to_pandas

        return to_pandas(self.columns())

    def to_geopandas(self) -> Any:
        """Return `columns` as a `geopandas.GeoDataFrame` of points; `PomonaError` when it is not installed."""
        from pomona.data_frames import to_geopandas

        return to_geopandas(self.columns(), self.positions_in_map)


@dataclass(frozen=True, eq=False, repr=False)
class FruitsInMap(FruitCloud):
    """The fruits of a map, which are where cameras drove along them.

    Attributes
    ----------
    parts : (N,) int64
        Part of the map that each fruit is of: how parts lie to each other nobody knows.
    ways : mapping of int to sequence of (F, 3) float64
        Where cameras went, in the frame of the fruits, for each session of a part that knows it.
    """

    parts: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    ways: Mapping[int, Sequence[NDArray[np.float64]]] = field(default_factory=dict)

    def transformed(self, map_from_query: ArrayLike) -> FruitsInMap:
        """Return fruits and ways in another frame, as `FruitCloud.transformed` does."""
        moved = super().transformed(map_from_query)
        assert isinstance(moved, FruitsInMap)
        transform = np.asarray(map_from_query, np.float64)
        ways = {
            part: [way @ transform[:3, :3].T + transform[:3, 3] for way in driven] for part, driven in self.ways.items()
        }
        return replace(moved, ways=ways)


class OrchardMap:
    """A map or session file for reading; every call sees the file as it is at that moment.

    In a `with` block all calls see the moment at which it began, and cost only what they ask.

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
        self._held: sqlite3.Connection | None = None
        self._holding = ExitStack()
        with snapshot(self.path) as (_, kind):
            self.kind = kind

    def __enter__(self) -> Self:
        self._held, _ = self._holding.enter_context(snapshot(self.path))
        return self

    def __exit__(self, *_: object) -> None:
        self._held = None
        self._holding.close()

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        if self._held is not None:
            with told(self.path):
                yield self._held
        else:
            with snapshot(self.path) as (connection, _):
                yield connection

    def __repr__(self) -> str:
        return f"OrchardMap({str(self.path)!r}, {self.kind})"

    def _repr_html_(self) -> str:
        visits = self.visits()
        rows = [(visit.name, visit.date, visit.n_fruits, visit.n_matched) for visit in visits]
        return as_table(f"{self.path}: {self.kind}", ("visit", "date", "fruits", "known before"), rows)

    def anchor(self) -> Anchor | None:
        """Return where on Earth the map lies, None where nobody has said: `pomona map georeference`."""
        with snapshot(self.path) as (connection, _):
            return stored_anchor(connection)

    def fruits(self) -> FruitsInMap:
        """Return every fruit where it was last seen, with its identity as id."""
        with self._reading() as connection:
            part_of = part_numbers(connection)
            (last_sessions,) = columns_of(connection, "fruits", ("last_session_id",))
            parts = parts_of_fruits(part_of, last_sessions)
            ways = camera_ways(connection, part_of)
            return fruits_in_map(connection, partial(FruitsInMap, parts=parts, ways=ways))

    @property
    def cloud(self) -> FruitCloud:
        """Every fruit, as `fruits` gives them now: a map is matched like a cloud."""
        return self.fruits()

    def visits(self) -> tuple[Visit, ...]:
        """Return the sessions in order of date."""
        names = ("id", "name", "date", "recording", "map_from_session", "method", "log_odds", "noise_m")
        with self._reading() as connection:
            rows = zip(*columns_of(connection, "sessions", names, "ORDER BY date, id"), strict=True)
            counts = {session_id: counted for session_id, *counted in connection.execute(COUNTS)}
            part_of = part_numbers(connection)
        return tuple(
            Visit(
                name=name,
                date=date,
                recording=recording,
                map_from_session=np.array(finite_json(transform)),
                n_fruits=counts.get(session_id, (0, 0))[0],
                n_matched=counts.get(session_id, (0, 0))[1],
                method=method,
                log_odds=log_odds,
                noise_m=noise_m,
                part=part_of[session_id] + 1,
            )
            for session_id, name, date, recording, transform, method, log_odds, noise_m in rows
        )

    def changes(self) -> list[tuple[str, str, Change]]:
        """Return what later evidence changed, in order: cause (added, removed), session, and the change."""
        names = ("cause", "session", "event", "from_fruit_id", "to_fruit_id", "n_observations")
        with self._reading() as connection:
            rows = zip(*columns_of(connection, "changes", names), strict=True)
            return [(cause, session, Change(*change)) for cause, session, *change in rows]

    def observations(self) -> Observations:
        """Return what was seen of each fruit, in order of fruit and date."""
        return self._observations("")

    def series(self, fruit_id: int) -> Observations:
        """Return what was seen of one fruit, in order of date; nothing of a fruit that is not there."""
        return self._observations(f"WHERE fruit_id = {int(fruit_id):d} ")

    def _observations(self, of_fruits: str) -> Observations:
        names = ("fruit_id", "session_id", "label", "geom", "diameter_m", "match_probability")
        in_order = f"JOIN sessions s ON s.id = session_id {of_fruits}ORDER BY fruit_id, s.date, s.id"
        with self._reading() as connection:
            fruit_ids, seen_by, labels, geoms, *numbers = columns_of(connection, "observations", names, in_order)
            those = one_of("sessions.id", set(seen_by))
            ids, names_of, dates_of = columns_of(connection, "sessions", ("id", "name", "date"), those)
        sessions, dates = dict(zip(ids, names_of, strict=True)), dict(zip(ids, dates_of, strict=True))
        diameters_m, probabilities = (np.array(column, dtype=np.float64) for column in numbers)
        return Observations(
            fruit_ids=np.array(fruit_ids, dtype=np.int64),
            sessions=tuple(sessions[session_id] for session_id in seen_by),
            dates=tuple(dates[session_id] for session_id in seen_by),
            labels=tuple(labels),
            positions_in_map=geopackage.points_of(geoms),
            diameters_m=diameters_m,
            probabilities=probabilities,
        )
