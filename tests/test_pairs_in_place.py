"""Two visits that no match joins, but a third does: what they saw of one fruit is one fruit."""

from dataclasses import replace
from datetime import date, timedelta

import numpy as np

from orchard_maker import frame_of_its_own
from pomona import FruitCloud
from pomona.identity import VisitPair
from pomona.orchard import Session
from pomona.orchard.evidence import Evidence, KnownVisit, new_visit
from pomona.orchard.pairs_in_place import unmatched


def orchard_seen(seen_by: list[list[int]], places: np.ndarray) -> tuple[list[KnownVisit], list[np.ndarray]]:
    """Visits that saw some of the places, 5 mm off, each in a frame of its own."""
    rng = np.random.default_rng(2)
    visits, frames = [], []
    for number, rows in enumerate(seen_by):
        frame = frame_of_its_own(rng)
        there = places[rows] + rng.normal(0, 0.005, (len(rows), 3))
        cloud = FruitCloud(there, diameters_m=np.full(len(rows), 0.06)).transformed(np.linalg.inv(frame))
        day = (date(2024, 7, 1) + timedelta(days=14 * number)).isoformat()
        visits.append(replace(new_visit(Session(day, day, "drawn", cloud)), session_id=number + 1))
        frames.append(frame)
    return visits, frames


def matched(
    visits: list[KnownVisit], frames: list[np.ndarray], seen_by: list[list[int]], first: int, second: int
) -> VisitPair:
    _, one, other = np.intersect1d(seen_by[first], seen_by[second], return_indices=True)
    pose = np.linalg.inv(frames[first]) @ frames[second]
    return VisitPair(first, second, pose, 50.0, np.stack([one, other], axis=1), np.full(len(one), 0.99))


def test_a_fruit_that_the_visit_between_missed_keeps_its_identity() -> None:
    places = np.random.default_rng(1).uniform((0, 0, 0), (2, 2, 0.5), (14, 3))
    # The one between did not see the last four.
    seen_by = [[*range(8), *range(10, 14)], list(range(10)), list(range(2, 14))]
    visits, frames = orchard_seen(seen_by, places)
    pairs = [matched(visits, frames, seen_by, 0, 1), matched(visits, frames, seen_by, 1, 2)]
    labels = Evidence(visits, pairs).conclusion().labels
    fruits = np.concatenate(seen_by)
    for fruit in range(len(places)):
        assert len(set(labels[fruits == fruit].tolist())) == 1
    assert len(set(labels.tolist())) == len(places)


def test_only_visits_of_few_fruits_are_asked_again() -> None:
    few, many = np.zeros((59, 3)), np.zeros((60, 3))
    days = ("2024-07-01", "2024-07-02", "2024-07-03")
    visits = [
        new_visit(Session(day, day, "drawn", FruitCloud(where))).seen
        for day, where in zip(days, (few, many, many), strict=True)
    ]
    assert unmatched(visits, []) == [(0, 1), (0, 2)]
    pose, rows = np.eye(4), np.zeros((1, 2), np.int64)
    assert unmatched(visits, [VisitPair(0, 2, pose, 5.0, rows, np.ones(1))]) == [(0, 1)]
