"""Whether a session is one that the map has: fruits that lie to each other, and are missed, as one visit saw them.

Who saves a table again changes its order, its frame, its last digits, its sizes or a few of its rows, and its hash says
nothing then. Two visits scatter by centimetres, or by millimetres within an hour, and each misses fruits that the other
sees and sees what is none; a copy has the fruits of one visit, its false points too, and has them nearer than fruits
are measured. So three things are asked, each of which a copy has to the least that can be: how far fruits lie as they
do in the other visit, and how many each of both has alone. Places alone tell; sizes may be measured anew.

A table that was rounded to centimetres is less like, as like as one visit in some hundred is where a sensor is good. It
keeps its frame, which two recordings have in common only where both were surveyed: then it is doubted, and added.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from pomona.identity import VisitPair
from pomona.orchard.evidence import Evidence, KnownVisit
from pomona.store.failures import WrongContentError

__all__ = ["doubted_copy"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

BESIDE = 3
"""Fruits next to one to which its distances are compared: that asks for no pose, and holds where a visit is torn. Most
have to be the same, as one of them may be changed."""

LEAST = 10
"""Matched fruits that say something."""

SCATTER_M = 0.02
"""By so much distances between neighbours differ from visit to visit, in the middle, where the map cannot say: 17 to
25 mm in drawn orchards."""

ONE_DAY_M = 0.004
"""The same for two visits of one day, when nothing grows or bends: with a sensor that errs by 2.5 mm. Apples that a
laboratory recorded again after minutes have 0.9 to 2.1 mm."""

TIMES = 0.7
"""Spread of the logarithm of either, a factor of two. No less where the map knows by how much the other visit differs
from several, as these may be of windy days or of another camera."""

ALONE = (1.5, 8.5)
"""Beta distribution of the share of fruits that one of two visits alone has: .15 in the mean, under .02 once in 20."""

REAL = 1e-4
"""A visit that is as like as one in so many real ones is a copy."""

DOUBTED = 1e-2
"""The same of a visit in the frame of the other, of which one in so many is told in vain. Of drawn copies that were
rounded to centimetres or moved by 3 mm some .2 are refused and .6 told."""

SAME_FRAME = 2.0
"""Up to so many times further than distances between neighbours differ fruits lie from where the other visit has them,
in the middle, if the frame is the same: 1.6 times where each errs by itself along each axis."""


def doubted_copy(
    connection: sqlite3.Connection, name: str, visit: KnownVisit, evidence: Evidence, matches: Mapping[int, VisitPair]
) -> str | None:
    """Refuse a visit, called `name`, that is more like one that it matches than two visits are.

    Returns
    -------
    str, optional
        Name of a session that it is as like as few are, in the same frame.
    """
    doubted = None
    for number, pair in sorted(matches.items()):
        if len(pair.rows) < LEAST:
            continue
        other = evidence.visits[number]
        own = int(visit.seen.key > other.seen.key)
        visits, rows = (visit, other), (pair.rows[:, own], pair.rows[:, 1 - own])
        scatter_m = _scatter_m(visits, rows)
        is_one_day = _are_of_one_day(visit, other)
        usual_m = min(_scatters_m(evidence, number, is_one_day), default=ONE_DAY_M if is_one_day else SCATTER_M)
        alone = [_alone(*both) for both in zip(visits, rows, strict=True)]
        chance = _chance_of_real(scatter_m / usual_m, alone)
        if chance >= DOUBTED:
            continue
        (there,) = connection.execute("SELECT name FROM sessions WHERE id = ?", (other.session_id,)).fetchone()
        if chance < REAL:
            raise WrongContentError(
                f"session {name} is in the map already, as {there}: {len(pair.rows)} of {alone[0][1]} fruits lie as "
                f"they do there, to {1e3 * scatter_m:.1f} mm, expected those of another visit, which are some "
                f"{1e3 * usual_m:.0f} mm off and not all the same"
            )
        if _apart_m(visits, rows) < SAME_FRAME * scatter_m:
            doubted = there
    return doubted


def _apart_m(visits: tuple[KnownVisit, KnownVisit], rows: tuple[Rows, Rows]) -> float:
    """Return how far matched fruits lie from each other, in the middle, as if the frames were the same."""
    places, others = (visit.cloud.positions[own] for visit, own in zip(visits, rows, strict=True))
    return float(np.median(np.linalg.norm(places - others, axis=1)))


def _are_of_one_day(visit: KnownVisit, other: KnownVisit) -> bool:
    return int(visit.seen.day // 1) == int(other.seen.day // 1)


def _scatters_m(evidence: Evidence, number: int, is_one_day: bool) -> Iterator[float]:
    """Give by how much a visit differs from the others of the map that it matches, of its own day or of other days."""
    for pair in evidence.pairs:
        visits = evidence.visits[pair.first], evidence.visits[pair.second]
        if number in (pair.first, pair.second) and len(pair.rows) >= LEAST and _are_of_one_day(*visits) == is_one_day:
            yield _scatter_m(visits, (pair.rows[:, 0], pair.rows[:, 1]))


def _scatter_m(visits: tuple[KnownVisit, KnownVisit], rows: tuple[Rows, Rows]) -> float:
    """Return by how much distances between neighbours among matched fruits differ, in the middle."""
    from scipy.spatial import cKDTree

    places, others = (visit.cloud.positions[own] for visit, own in zip(visits, rows, strict=True))
    beside = np.asarray(cKDTree(places).query(places, k=BESIDE + 1)[1])[:, 1:]
    return float(np.median(np.median(np.abs(_to(places, beside) - _to(others, beside)), axis=1)))


def _to(places: Array, beside: Rows) -> Array:
    """Give the distance from each place to those beside it, (N, K)."""
    return np.asarray(np.linalg.norm(places[beside] - places[:, None], axis=2), np.float64)


def _alone(visit: KnownVisit, rows: Rows) -> tuple[int, int]:
    """Count the fruits that the other visit has not, and all, where it looked: where it has the fruit next to each."""
    from scipy.spatial import cKDTree

    places = visit.cloud.positions
    is_matched = np.zeros(len(places), bool)
    is_matched[rows] = True
    beside = np.asarray(cKDTree(places).query(places, k=2)[1])[:, 1]
    n_alone = int((~is_matched & is_matched[beside]).sum())
    return n_alone, n_alone + len(rows)


def _chance_of_real(scatter: float, alone: list[tuple[int, int]]) -> float:
    """Return the chance that a real visit is as like another: `scatter` in what is usual, fruits alone of all.

    By the scatter alone, as rows may be added to a copy and taken away, or by the product of all three chances
    (Fisher). One of the two is enough: hence twice the less.
    """
    from scipy.special import ndtr

    near = float(ndtr(np.log(max(scatter, 1e-9)) / TIMES))
    log_product = np.log(near) + sum(np.log(_chance_of_fewer(*counts)) for counts in alone)
    return 2.0 * min(near, float(np.exp(log_product) * (1.0 - log_product + 0.5 * log_product**2)))


def _chance_of_fewer(count: int, n: int) -> float:
    """Return the chance that no more than so many of n are alone: the beta-binomial distribution."""
    from scipy.special import betaln

    each = np.arange(count + 1.0)
    first, second = ALONE
    log_ways = -np.log(n + 1.0) - betaln(n - each + 1.0, each + 1.0)
    log_chances = log_ways + betaln(each + first, n - each + second) - betaln(first, second)
    return min(float(np.exp(log_chances).sum()), 1.0)
