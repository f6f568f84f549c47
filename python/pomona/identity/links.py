"""Signed log-odds between the sights of all visits: what every pair of visits says of who is who."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.identity.left_out import nats_against
from pomona.identity.sizes import size_log_odds
from pomona.identity.visits import Sights, VisitPair

__all__ = ["Links", "links_of"]

SUREST = 8.0
"""Nats of a pair at most: of 3,000 that a match is surest of one may be wrong."""

UNCOVERED = 0.4
"""Nats against a pair beforehand: where a fruit went, its neighbour in the cluster may be seen for the first time, and
a match of two visits takes it for the same. Probabilities of matches hold most of that: with 1.25 one pair in forty of
hard drawn seasons was lost, for one in 250 that was wrong."""

GOES_IN_DAYS = 1.0
"""Between visits that are nearer in time no fruit goes."""

LEAST_SURE = 0.0
"""Nats of a pair at least, before that: what a match pairs is doubted no more than so much; sizes may outweigh it."""


@dataclass(frozen=True, eq=False)
class Links:
    """Pairs of sights that a match joined, and which visits were matched.

    Attributes
    ----------
    sights : (L, 2) int64
        The earlier one first.
    log_odds : (L,) float64
        That the two are one fruit; positive and negative.
    matched : (M, 2) int64
        Visits that were found in one another: then a pair that is not there speaks against.
    against : (M,) float64
        How much it speaks against, nats.
    """

    sights: NDArray[np.int64]
    log_odds: NDArray[np.float64]
    matched: NDArray[np.int64]
    against: NDArray[np.float64]


def links_of(sights: Sights, pairs: Sequence[VisitPair]) -> Links:
    """Put the pairs of all matches together, sizes weighed in."""
    found, log_odds = [np.empty((0, 2), np.int64)], [np.empty(0)]
    for pair in pairs:
        linked = pair.rows + sights.starts[[pair.first, pair.second]]
        found.append(linked)
        goes = abs(sights.days[pair.second] - sights.days[pair.first]) >= GOES_IN_DAYS
        by_place = _by_place(pair.probabilities) - (UNCOVERED if goes else 0.0)
        log_odds.append(by_place + _by_size(sights, pair, linked))
    matched = np.array([(pair.first, pair.second) for pair in pairs], np.int64).reshape(-1, 2)
    return Links(np.concatenate(found), np.concatenate(log_odds), matched, nats_against(sights, pairs))


def _by_place(probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
    with np.errstate(divide="ignore"):
        return np.asarray(np.clip(np.log(probabilities) - np.log1p(-probabilities), LEAST_SURE, SUREST))


def _by_size(sights: Sights, pair: VisitPair, linked: NDArray[np.int64]) -> NDArray[np.float64]:
    first, second = (sights.log_sizes[sights.visits == visit] for visit in (pair.first, pair.second))
    of_pairs = sights.log_sizes[linked]
    return size_log_odds((first, second), (of_pairs[:, 0], of_pairs[:, 1]), pair.probabilities)
