"""Pairs of visits that lie to each other as others say: those of few fruits are not always found in one another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.identity import SeenVisit, VisitPair
from pomona.matching import Index

__all__ = ["pairs_in_place", "unmatched"]

FEW = 60
"""Fruits of a visit of which a match by itself is not sure to find it; asked under a known pose in two milliseconds."""

MARGIN_M = 0.5
"""Between visits that still may have seen the same fruits."""

SAME_SCALE = 1e-3
"""By less than this two visits are in one unit, as the pairs of a known pose need it."""


def unmatched(visits: Sequence[SeenVisit], pairs: Sequence[VisitPair]) -> list[tuple[int, int]]:
    """Return the visits that no match joins though they may have seen the same fruits, one of them a few."""
    matched = {(pair.first, pair.second) for pair in pairs}
    sizes = [len(visit.positions) for visit in visits]
    return [
        (first, second)
        for first, second in combinations(range(len(visits)), 2)
        if (first, second) not in matched and 0 < min(sizes[first], sizes[second]) < FEW
    ]


def pairs_in_place(
    visits: Sequence[SeenVisit], asked: Sequence[tuple[int, int]], frames: NDArray[np.float64]
) -> Iterator[VisitPair]:
    """Give how visits match where they lie, (V, 4, 4): the pose is known, who is who among what is near is asked.

    What a match from nothing does not find has no less to say: a fruit that only these two saw is told by no other.
    """
    for first, second in asked:
        first_from_second = np.linalg.inv(frames[first]) @ frames[second]
        is_one_unit = abs(np.cbrt(np.linalg.det(first_from_second[:3, :3])) - 1.0) < SAME_SCALE
        if not is_one_unit or _are_apart(visits[first], visits[second], first_from_second):
            continue
        found = Index(_cloud(visits[first]), threads=1).pairs_under(_cloud(visits[second]), first_from_second)
        if len(found.pairs):
            log_odds = float(np.nan_to_num(found.log_odds))
            yield VisitPair(first, second, first_from_second, log_odds, found.pairs[:, ::-1], found.probabilities)


def _are_apart(first: SeenVisit, second: SeenVisit, first_from_second: NDArray[np.float64]) -> bool:
    laid = second.positions @ first_from_second[:3, :3].T + first_from_second[:3, 3]
    low, high = first.positions.min(axis=0) - MARGIN_M, first.positions.max(axis=0) + MARGIN_M
    return bool((laid.min(axis=0) > high).any() or (laid.max(axis=0) < low).any())


def _cloud(visit: SeenVisit) -> FruitCloud:
    are_known = not np.isnan(visit.diameters_m).all()
    return FruitCloud(
        visit.positions, diameters_m=visit.diameters_m if are_known else None, covariances=visit.covariances
    )
