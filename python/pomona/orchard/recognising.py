"""A session against the map: where it lies there, and how it matches every visit that may have seen the same fruits."""

from __future__ import annotations

import sqlite3
from collections import defaultdict
from collections.abc import Collection, Container, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.cloud import FruitCloud
from pomona.identity import VisitPair, seasons_of
from pomona.orchard.evidence import Evidence, KnownVisit
from pomona.orchard.hanging import may_hang
from pomona.settings import Settings
from pomona.store.failures import WrongContentError
from pomona.store.rows import columns_of, one_of
from pomona.store.stored_fruits import fruit_places, fruits_in_map
from pomona.threads import capped_threads, cores

if TYPE_CHECKING:
    from pomona.matching import Match, ReadyCloud

__all__ = [
    "MARGIN_M",
    "Recognised",
    "Sight",
    "matches_between",
    "matches_through_fruits",
    "matches_with_visits",
    "recognised",
    "seen_last_by",
    "sights_of_fruits",
    "worth_recognising",
]

MARGIN_M = 0.5
"""Between visits that still are compared: trees sag and trajectories drift by less."""

PLACE_DIGITS, COVARIANCE_DIGITS = 9, 15
"""Of metres and of square metres, with which a match of two visits is asked."""

LARGE = 10_000
"""Fruits of a map of which the surroundings of a session are chosen first; fewer are made ready in half a second."""

NEARBY_M = 1.5
"""From the fruits of a session, as it seems to lie: what it may have seen. Of the farthest, a guess is off by less."""

Sight = tuple[int, int]
"""A visit, and its row for a fruit."""


@dataclass(frozen=True, eq=False)
class Recognised:
    """How a session was found in the map, or not.

    Attributes
    ----------
    match : Match
    known : FruitCloud
        The fruits that `match` is with.
    """

    match: Match
    known: FruitCloud

    @property
    def is_found(self) -> bool:
        """Whether the session lies in the map."""
        return self.match.status.value == "Found"

    @property
    def fruit_ids(self) -> NDArray[np.int64]:
        """Of the fruits that `match` is with."""
        return np.array(self.known.ids, np.int64)


def recognised(
    connection: sqlite3.Connection, cloud: FruitCloud, settings: Settings, among: Collection[int] | None = None
) -> Recognised:
    """Look for a session in the map, or among the fruits that some sessions of it saw last.

    In a large one among the fruits where it seems to lie, and among all of them where it is not found there; then among
    those of seasons before, as the first visit of this season to a stretch may be.
    """
    asked = "" if among is None else one_of("last_session_id", among)
    nearby = _nearby(connection, cloud, settings, asked)
    if nearby:
        known = worth_recognising(fruits_in_map(connection, FruitCloud, nearby))
        found = Recognised(settings.match(cloud, known), known)
        if found.is_found:
            return found
    ids = columns_of(connection, "fruits", ("id",), asked)[0] if asked else None
    fruits = fruits_in_map(connection, FruitCloud, ids)
    if not len(fruits):
        raise WrongContentError("has sessions and no fruits, expected at least one")
    known = worth_recognising(fruits)
    found = Recognised(settings.match(cloud, known), known)
    before = fruits.select(_are_of_seasons_before(fruits))
    if found.is_found or not len(before):
        return found
    earlier = Recognised(settings.match(cloud, before), before)
    return earlier if earlier.is_found else found


def worth_recognising(fruits: FruitCloud) -> FruitCloud:
    """Return the fruits that may still hang: those gone, and what never was a fruit, only look like others."""
    hanging = may_hang(fruits)
    return fruits.select(hanging) if hanging.any() else fruits


def _are_of_seasons_before(fruits: FruitCloud) -> NDArray[np.bool_]:
    """Tell the fruits of a map, (N,), that a winter took."""
    last_seen = [datetime.fromisoformat(day).toordinal() for day in fruits.extras["last_seen"]]
    days, of_day = np.unique(last_seen, return_inverse=True)
    return np.asarray(of_day < seasons_of(days)[-1].start)


def _nearby(connection: sqlite3.Connection, cloud: FruitCloud, settings: Settings, asked: str) -> list[int]:
    """Return those of the fruits asked for, of a large map, among which a session seems to lie; or none."""
    from scipy.spatial import cKDTree

    (n_fruits,) = connection.execute("SELECT count(*) FROM fruits").fetchone()
    if n_fruits < LARGE or settings.call["scale"] != "metric":
        return []
    ids, places = fruit_places(connection, asked)
    guess = _core.whereabouts(places, np.ascontiguousarray(cloud.positions))
    if guess is None:
        return []
    in_map = cloud.transformed(np.array(guess[0])).positions
    low, high = in_map.min(axis=0) - NEARBY_M, in_map.max(axis=0) + NEARBY_M
    around = np.flatnonzero(((places >= low) & (places <= high)).all(axis=1))
    distances_m, _ = cKDTree(in_map).query(places[around], distance_upper_bound=NEARBY_M)
    chosen: list[int] = ids[around[np.isfinite(distances_m)]].tolist()
    return chosen


def seen_last_by(connection: sqlite3.Connection, found: Recognised) -> set[int]:
    """Return the sessions that saw the fruits last in which something was found."""
    seen_again = found.fruit_ids[found.match.pairs[:, 1]].tolist()
    (session_ids,) = columns_of(connection, "fruits", ("last_session_id",), one_of("fruits.id", seen_again))
    return set(session_ids)


def matches_with_visits(
    evidence: Evidence, visit: KnownVisit, found: Recognised, settings: Settings, rows: NDArray[np.int64]
) -> dict[int, VisitPair]:
    """Return how a visit matches each other one in which it was found, by the number of that one.

    Each match asks the two visits alone, the later one as the query, so that it is the same whoever came first. A visit
    that is in none of the others by itself, as only the whole map has enough of its fruits, is matched as it was found
    in the map.

    Parameters
    ----------
    evidence, visit
        The parts of the map where the visit was found, and the new visit.
    found
        How it was found there.
    settings
        Of the match.
    rows
        Those of the visit that were looked for there.
    """
    assert found.match.map_from_query is not None
    matches = matches_between(evidence, visit, found.match.map_from_query, settings)
    sights = [[(0, row)] for row in rows.tolist()]
    return matches or matches_through_fruits(evidence, found, [visit], sights).get(0, {})


def matches_between(
    evidence: Evidence,
    visit: KnownVisit,
    map_from_visit: NDArray[np.float64],
    settings: Settings,
    but: Container[int] = (),
) -> dict[int, VisitPair]:
    """Return how a visit that seems to lie there in the map matches each other one that is not apart from it.

    Sessions in `but` are not asked.
    """
    in_map = replace(visit, map_from_session=map_from_visit).places_in_map
    numbers = [
        number
        for number, other in enumerate(evidence.visits)
        if other.session_id not in but and not _are_apart(in_map, other)
    ]
    asked = Settings({**settings.call, "up": None, "per_frame": False, "threads": 1}, settings.overrides)
    if not numbers:
        return {}
    own = _Side(visit.seen.key, asked.ready(_rounded(visit.cloud)), map_from_visit)

    def match_with(number: int) -> VisitPair | None:
        other = evidence.visits[number]
        return _match_of_two(
            own, _Side(other.seen.key, asked.ready(_rounded(other.cloud)), other.map_from_session), asked
        )

    with ThreadPoolExecutor(capped_threads(settings.call["threads"]) or cores()) as pool:
        found = pool.map(match_with, numbers)
        return {number: pair for number, pair in zip(numbers, found, strict=True) if pair is not None}


@dataclass(frozen=True, eq=False)
class _Side:
    """One of two visits that are matched: its key, its cloud made ready, and where it seems to lie in the map."""

    key: tuple[str, str]
    cloud: FruitCloud | ReadyCloud
    map_from_visit: NDArray[np.float64]


def _match_of_two(one: _Side, other: _Side, settings: Settings) -> VisitPair | None:
    """Return how two visits match; where they seem to lie saves a search, and changes nothing of what is found."""
    query, map_ = (one, other) if one.key > other.key else (other, one)
    expected = np.linalg.inv(map_.map_from_visit) @ query.map_from_visit
    match = settings.match_expected(query.cloud, map_.cloud, expected)
    if match.status.value != "Found":
        return None
    assert match.map_from_query is not None
    return VisitPair(0, 0, match.map_from_query, match.log_odds, match.pairs[:, ::-1], match.probabilities)


def _rounded(cloud: FruitCloud) -> FruitCloud:
    """Leave out the digits that a place loses on its way into the frame of a map and back.

    Steps of a match end where they are small enough: with the last digit of a place their number changes, and with
    that the sixth of the pose. So the same visits are asked about with the same digits, whichever came first.
    """
    covariances = cloud.covariances
    return replace(
        cloud,
        positions=np.round(cloud.positions, PLACE_DIGITS),
        covariances=None if covariances is None else np.round(covariances, COVARIANCE_DIGITS),
    )


def _are_apart(in_map: NDArray[np.float64], other: KnownVisit) -> bool:
    """Tell whether two visits saw other places; that takes less than to match them."""
    if not len(other.cloud):
        return True
    others = other.places_in_map
    low, high = others.min(axis=0) - MARGIN_M, others.max(axis=0) + MARGIN_M
    return bool((in_map.min(axis=0) > high).any() or (in_map.max(axis=0) < low).any())


def matches_through_fruits(
    evidence: Evidence, found: Recognised, visits: Sequence[KnownVisit], sights: Sequence[Sequence[Sight]]
) -> dict[int, dict[int, VisitPair]]:
    """Return how visits match those of the map that saw the same fruits, by the numbers of both.

    A fruit that was found is known to every visit that saw it, not to the last alone: what a match of two visits
    does not pair speaks against being one fruit, and would part the last sight of a fruit from those before.

    Parameters
    ----------
    evidence, found
        Visits of the map, and how the query was found in it.
    visits
        Of the query, where they lie in its frame.
    sights
        For each row of the query all visits that saw it, with their rows.
    """
    match, all_sights = found.match, sights_of_fruits(evidence)
    assert match.map_from_query is not None
    of_pairs = zip(match.pairs[:, 0].tolist(), found.fruit_ids[match.pairs[:, 1]].tolist(), strict=True)
    between: dict[tuple[int, int], list[tuple[int, int, int]]] = defaultdict(list)
    for place, (asked, fruit_id) in enumerate(of_pairs):
        for (mine, row), (other, other_row) in product(sights[asked], all_sights[fruit_id]):
            between[mine, other].append((other_row, row, place))
    matches: dict[int, dict[int, VisitPair]] = defaultdict(dict)
    for (mine, other), rows in sorted(between.items()):
        map_from_other = evidence.visits[other].map_from_session
        other_from_mine = np.linalg.inv(map_from_other) @ match.map_from_query @ visits[mine].map_from_session
        table = np.array(rows, np.int64)
        pair = VisitPair(0, 0, other_from_mine, match.log_odds, table[:, :2], match.probabilities[table[:, 2]])
        is_later = visits[mine].seen.key > evidence.visits[other].seen.key
        matches[mine][other] = pair if is_later else _turned(pair)
    return matches


def _turned(pair: VisitPair) -> VisitPair:
    """Return a pair with its first visit second."""
    first_from_second = np.asarray(np.linalg.inv(pair.first_from_second), np.float64)
    return replace(pair, first_from_second=first_from_second, rows=pair.rows[:, ::-1])


def sights_of_fruits(evidence: Evidence) -> Mapping[int, Sequence[Sight]]:
    """Return the visits that saw each fruit, with its row there."""
    sights: dict[int, list[Sight]] = defaultdict(list)
    for number, visit in enumerate(evidence.visits):
        for row, fruit_id in enumerate(visit.fruit_ids.tolist()):
            sights[fruit_id].append((number, row))
    return sights
