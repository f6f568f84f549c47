"""How much a match speaks against two sights that it left apart: as much as it pairs what other visits pair.

Two visits to one side of a row, a week apart, leave out 3 in 100 of the fruits that both have seen. Of visits from two
sides, or with branches that sank in between, a match may leave out half, and then that it left two sights apart says
next to nothing. How many it leaves out the other visits tell: where a visit between pairs a sight of the first, and
that a sight of the second, the two are one fruit as surely as both pairs are right.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pomona.identity.visits import Sights, VisitPair

__all__ = ["nats_against"]

USUAL, WORTH = 0.03, 20.0
"""Share that a match leaves out before any visit tells, and how many fruits that is worth."""

BETWEEN = 8
"""Visits that are asked, at the most: those nearest in time."""


class _Partners(NamedTuple):
    """Of every sight of a visit its partner in another."""

    rows: NDArray[np.int64]
    """-1 for none."""
    probabilities: NDArray[np.float64]


def nats_against(sights: Sights, pairs: Sequence[VisitPair]) -> NDArray[np.float64]:
    """Tell how much each match speaks against two sights that it left apart, nats above 0, by what the others pair."""
    partners, days = dict(_partners(sights, pairs)), sights.days

    def share(pair: VisitPair) -> float:
        ends = (pair.first, pair.second)
        between = [visit for visit in range(len(days)) if {(ends[0], visit), (visit, ends[1])} <= partners.keys()]
        between.sort(key=lambda visit: (np.abs(days[visit] - days[list(ends)]).sum(), visit))
        return _share_left_out(ends, between[:BETWEEN], partners)

    return np.asarray(-np.log(np.array([share(pair) for pair in pairs], float)))


def _partners(sights: Sights, pairs: Sequence[VisitPair]) -> Iterator[tuple[tuple[int, int], _Partners]]:
    counts = np.bincount(sights.visits, minlength=len(sights.days))
    for pair in pairs:
        ends = ((pair.first, *pair.rows.T), (pair.second, *pair.rows.T[::-1]))
        for (one, here, there), (other, *_) in zip(ends, ends[::-1], strict=True):
            rows, probabilities = np.full(counts[one], -1), np.zeros(counts[one])
            rows[here], probabilities[here] = there, pair.probabilities
            yield (one, other), _Partners(rows, probabilities)


def _share_left_out(
    ends: tuple[int, int], between: Sequence[int], partners: Mapping[tuple[int, int], _Partners]
) -> float:
    """Share of the fruits of two visits that their match leaves out, by the mean of what the visits between say."""
    direct = partners[ends].rows
    left_out = paired = 0.0
    for visit in between:
        there, back = partners[ends[0], visit], partners[visit, ends[1]]
        on = np.flatnonzero(there.rows >= 0)
        on = on[back.rows[there.rows[on]] >= 0]
        right = there.probabilities[on] * back.probabilities[there.rows[on]]
        agrees = back.rows[there.rows[on]] == direct[on]
        paired += float(agrees.sum()) / len(between)
        left_out += float(right[~agrees].sum()) / len(between)
    return (left_out + USUAL * WORTH) / (left_out + paired + WORTH)
