"""What the map holds of its sessions and their matches: all that identities follow from."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.identity import Conclusion, SeenVisit, VisitPair, conclude, frames_of_visits
from pomona.orchard.pairs_in_place import pairs_in_place, unmatched
from pomona.orchard.parts import components
from pomona.orchard.session import Session
from pomona.orchard.stored_sessions import cameras_in_map
from pomona.store.cells import finite_json
from pomona.store.failures import WrongContentError
from pomona.store.rows import columns_of, one_of, parsed_column
from pomona.store.stored_fruits import SeenBySession, seen_by_sessions

__all__ = ["Evidence", "KnownVisit", "new_visit", "read_evidence"]

BEGINNING = datetime(2000, 1, 1)
"""Days are counted from here, in the orchard's local time."""


@dataclass(frozen=True, eq=False)
class KnownVisit:
    """One session as the map holds it.

    Attributes
    ----------
    session_id : int
        0 or less for one that is not in the map yet.
    date : str
    cloud : FruitCloud
        In the session's own frame.
    seen : SeenVisit
        The same for the identities.
    map_from_session : (4, 4) float64
    observation_ids, fruit_ids : (N,) int64
        Of each fruit of the cloud; 0 where it has none yet.
    match_probabilities, match_distances_m : (N,) float64
        How surely and how far from its fruit's sight before the map has each of them; NaN where it says nothing.
    """

    session_id: int
    date: str
    cloud: FruitCloud
    seen: SeenVisit
    map_from_session: NDArray[np.float64]
    observation_ids: NDArray[np.int64]
    fruit_ids: NDArray[np.int64]
    match_probabilities: NDArray[np.float64]
    match_distances_m: NDArray[np.float64]

    @property
    def places_in_map(self) -> NDArray[np.float64]:
        """Where its fruits are in the map, (N, 3)."""
        return self.cloud.positions @ self.map_from_session[:3, :3].T + self.map_from_session[:3, 3]


@dataclass(frozen=True, eq=False)
class Evidence:
    """Visits of one or more parts of the map, in the order of date and content, and their matches."""

    visits: Sequence[KnownVisit]
    pairs: Sequence[VisitPair]

    def with_visit(self, visit: KnownVisit, matches: Mapping[int, VisitPair]) -> Evidence:
        """Return it with one visit more; `matches` by the number of the other visit, the earlier of both first."""
        visits = sorted([*self.visits, visit], key=lambda one: one.seen.key)
        own = visits.index(visit)
        pairs = [
            replace(pair, first=pair.first + (pair.first >= own), second=pair.second + (pair.second >= own))
            for pair in self.pairs
        ]
        for other, match in matches.items():
            first, second = sorted((own, other + (other >= own)))
            pairs.append(replace(match, first=first, second=second))
        return Evidence(visits, pairs)

    @classmethod
    def of_parts(cls, parts: Sequence[Evidence], across: Iterable[tuple[int, int, VisitPair]]) -> Evidence:
        """Put parts together; `across` are matches between them, each after the sessions that it is of."""
        visits = sorted((visit for part in parts for visit in part.visits), key=lambda one: one.seen.key)
        numbers = {visit.session_id: number for number, visit in enumerate(visits)}
        inside = [
            (part.visits[pair.first].session_id, part.visits[pair.second].session_id, pair)
            for part in parts
            for pair in part.pairs
        ]
        pairs = [
            replace(pair, first=numbers[first], second=numbers[second]) for first, second, pair in (*inside, *across)
        ]
        return cls(visits, pairs)

    def without_session(self, session_id: int) -> Evidence:
        """Return it with one visit less."""
        gone = self.number_of(session_id)
        return self._of([number for number in range(len(self.visits)) if number != gone])

    def parts(self) -> list[Evidence]:
        """Return the visits that hang together by their matches, each part for itself."""
        numbers = range(len(self.visits))
        return [self._of(part) for part in components(numbers, ((pair.first, pair.second) for pair in self.pairs))]

    def _of(self, numbers: Sequence[int]) -> Evidence:
        """Return what these visits say, and their matches with one another."""
        now = {number: at for at, number in enumerate(numbers)}
        pairs = [
            replace(pair, first=now[pair.first], second=now[pair.second])
            for pair in self.pairs
            if pair.first in now and pair.second in now
        ]
        return Evidence([self.visits[number] for number in numbers], pairs)

    def number_of(self, session_id: int) -> int:
        """Return the number of a visit."""
        return [visit.session_id for visit in self.visits].index(session_id)

    @property
    def fruit_ids(self) -> NDArray[np.int64]:
        """Fruit of every sight, as the map has it; 0 where it has none yet."""
        return np.concatenate([visit.fruit_ids for visit in self.visits])

    @property
    def observation_ids(self) -> NDArray[np.int64]:
        """Observation of every sight; 0 where it is not in the map yet."""
        return np.concatenate([visit.observation_ids for visit in self.visits])

    @property
    def match_probabilities(self) -> NDArray[np.float64]:
        """How surely every sight is of its fruit, as the map has it; NaN where it says nothing."""
        return np.concatenate([visit.match_probabilities for visit in self.visits])

    @property
    def match_distances_m(self) -> NDArray[np.float64]:
        """How far every sight is from its fruit's sight before, as the map has it; NaN where it says nothing."""
        return np.concatenate([visit.match_distances_m for visit in self.visits])

    def conclusion(self) -> Conclusion:
        """Say what follows for visits that hang together; the sessions that came first stay where they are."""
        known = np.array([visit.map_from_session for visit in self.visits])
        newest_last = [(visit.session_id < 1, abs(visit.session_id)) for visit in self.visits]
        keepers = sorted(range(len(self.visits)), key=newest_last.__getitem__)
        seen = [visit.seen for visit in self.visits]
        pairs = list(self.pairs)
        if asked := unmatched(seen, pairs):
            pairs += pairs_in_place(seen, asked, frames_of_visits(seen, self.pairs, known, keepers))
        return conclude(seen, pairs, known, keepers)


def read_evidence(connection: sqlite3.Connection, session_ids: Sequence[int]) -> Evidence:
    """Read these sessions of a map and how they match one another."""
    names = ("id", "date", "content_sha256", "map_from_session")
    wanted = one_of("sessions.id", session_ids)
    rows = sorted(zip(*columns_of(connection, "sessions", names, wanted), strict=True), key=lambda row: row[1:3])
    seen = seen_by_sessions(connection, [row[0] for row in rows], FruitCloud)
    visits = [
        _known_visit(connection, seen[session_id], (date, content), np.array(finite_json(transform), np.float64))
        for session_id, date, content, transform in rows
    ]
    return Evidence(visits, _pairs(connection, visits))


def _known_visit(
    connection: sqlite3.Connection,
    seen: SeenBySession,
    key: tuple[str, str],
    map_from_session: NDArray[np.float64],
) -> KnownVisit:
    session_from_map = np.linalg.inv(map_from_session)
    cloud = seen.cloud.transformed(session_from_map)
    cameras = cameras_in_map(connection, seen.session_id)
    return KnownVisit(
        session_id=seen.session_id,
        date=key[0],
        cloud=cloud,
        seen=_seen_visit(key, cloud, None if cameras is None else _rigid(session_from_map @ cameras[2])),
        map_from_session=map_from_session,
        observation_ids=seen.observation_ids,
        fruit_ids=seen.fruit_ids,
        match_probabilities=seen.match_probabilities,
        match_distances_m=seen.match_distances_m,
    )


def _seen_visit(key: tuple[str, str], cloud: FruitCloud, cameras: NDArray[np.float64] | None) -> SeenVisit:
    """Return what a session saw in the words of the identities."""
    unknown = np.full(len(cloud), np.nan)
    return SeenVisit(
        key=key,
        day=(datetime.fromisoformat(key[0]) - BEGINNING) / timedelta(days=1),
        positions=cloud.positions,
        diameters_m=unknown if cloud.diameters_m is None else cloud.diameters_m,
        covariances=cloud.covariances,
        n_views=cloud.n_views,
        cameras=cameras,
    )


def _rigid(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses with axes of length one; those of a session of unknown scale have come by a similarity."""
    poses = poses.copy()
    poses[:, :3, :3] /= np.cbrt(np.linalg.det(poses[:, :3, :3]))[:, None, None]
    return poses


def _pairs(connection: sqlite3.Connection, visits: Sequence[KnownVisit]) -> list[VisitPair]:
    numbers = {visit.session_id: number for number, visit in enumerate(visits)}
    names = ("id", "first_session_id", "second_session_id", "log_odds")
    wanted = one_of("first_session_id", numbers)
    columns = columns_of(connection, "matches", names, wanted)
    parsed = (parsed_column(connection, "matches", name, wanted) for name in ("first_from_second", "pairs"))
    found = []
    for match_id, first, second, log_odds, transform, cells in zip(*columns, *parsed, strict=True):
        if second not in numbers:
            continue
        asked = (numbers[first], numbers[second])
        found.append(
            VisitPair(
                *asked,
                first_from_second=transform,
                log_odds=log_odds,
                rows=_rows(match_id, visits, asked, cells[:, :2].astype(np.int64)),
                probabilities=cells[:, 2].copy(),
            )
        )
    return found


def _rows(
    match_id: int, visits: Sequence[KnownVisit], numbers: tuple[int, int], ids: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the rows of the two visits, (M, 2), that the observations of a match are."""
    rows = np.zeros(ids.shape, np.int64)
    for side, number in enumerate(numbers):
        own = visits[number].observation_ids
        rows[:, side] = np.searchsorted(own, ids[:, side])
        strange = ~np.isin(ids[:, side], own)
        if strange.any():
            found = ids[np.argmax(strange), side]
            raise WrongContentError(f"matches {match_id}: pairs: found {found}, expected observations of its sessions")
    return rows


def new_visit(session: Session, content: str = "") -> KnownVisit:
    """Return a session that is not in the map yet; where it lies there nobody knows.

    `content` is the hash of what was seen, where the session is not as it was seen any more.
    """
    cameras = None if session.trajectory is None else session.trajectory.session_from_camera
    return KnownVisit(
        session_id=0,
        date=session.date,
        cloud=session.cloud,
        seen=_seen_visit((session.date, content or session.content_sha256), session.cloud, cameras),
        map_from_session=np.eye(4),
        observation_ids=np.zeros(len(session.cloud), np.int64),
        fruit_ids=np.zeros(len(session.cloud), np.int64),
        match_probabilities=np.full(len(session.cloud), np.nan),
        match_distances_m=np.full(len(session.cloud), np.nan),
    )
