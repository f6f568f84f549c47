"""Correlation clustering of signed log-odds: who is one fruit, two sights of one visit never.

Greedy contraction (Keuper and others, 2015): the two clusters with the most evidence for being one are joined until no
two are better joined. Evidence of two clusters is the sum over all pairs of their sights, of which most are links or
speak against by `UNPAIRED`. The most evidence goes first whatever the order of the visits' coming.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pomona.identity.links import UNPAIRED, Links
from pomona.identity.visits import Sights

__all__ = ["contracted"]

Candidate = tuple[float, int, int, int, int]
"""Evidence with its sign changed, two clusters, and how often each had grown: a heap gives the least first."""


class Clusters:
    """Clusters of sights while they grow; a cluster is called by one of its sights."""

    def __init__(self, sights: Sights, links: Links) -> None:
        self.visits = [1 << visit for visit in sights.visits.tolist()]
        self.sights = [[sight] for sight in range(len(sights))]
        self.grown = [0] * len(sights)
        self.linked: list[dict[int, float]] = [{} for _ in range(len(sights))]
        for (one, other), log_odds in zip(links.sights.tolist(), links.log_odds.tolist(), strict=True):
            # Beyond what is said against every pair of sights.
            self.linked[one][other] = self.linked[other][one] = log_odds + UNPAIRED
        self.matched = [int(sum(1 << int(other) for other in np.flatnonzero(row))) for row in links.is_matched]

    def candidates(self, cluster: int) -> Iterator[Candidate]:
        """Give those that a cluster is better joined with."""
        for other in self.linked[cluster]:
            evidence = self.evidence(cluster, other)
            if evidence > 0:
                one, two = min(cluster, other), max(cluster, other)
                yield -evidence, one, two, self.grown[one], self.grown[two]

    def evidence(self, one: int, other: int) -> float:
        """Return the log-odds that two clusters are one fruit; minus infinity where one visit saw both."""
        visits, others = self.visits[one], self.visits[other]
        if visits & others:
            return -math.inf
        n_against: int = sum((self.matched[visit] & others).bit_count() for visit in _bits(visits))
        return self.linked[one][other] - UNPAIRED * n_against

    def is_as_it_was(self, candidate: Candidate) -> bool:
        """Tell whether both clusters are still there, and no larger."""
        _, one, other, grown, other_grown = candidate
        return self.grown[one] == grown and self.grown[other] == other_grown

    def join(self, kept: int, gone: int) -> None:
        """Make one cluster of two."""
        self.visits[kept] |= self.visits[gone]
        self.sights[kept] += self.sights[gone]
        self.sights[gone] = []
        self.grown[kept] += 1
        self.grown[gone] = -1
        own = self.linked[kept]
        for other, log_odds in self.linked[gone].items():
            del self.linked[other][gone]
            if other != kept:
                own[other] = self.linked[other][kept] = own.get(other, 0.0) + log_odds
        self.linked[gone] = {}


def contracted(sights: Sights, links: Links) -> NDArray[np.int64]:
    """Return the cluster of every sight, (S,), numbered from 0 in the order of their first sights."""
    clusters = Clusters(sights, links)
    heap = [candidate for cluster in range(len(sights)) for candidate in clusters.candidates(cluster)]
    heapq.heapify(heap)
    while heap:
        candidate = heapq.heappop(heap)
        if clusters.is_as_it_was(candidate):
            _, kept, gone, *_ = candidate
            clusters.join(kept, gone)
            for next_one in clusters.candidates(kept):
                heapq.heappush(heap, next_one)
    return _numbered(clusters, len(sights))


def _numbered(clusters: Clusters, n_sights: int) -> NDArray[np.int64]:
    labels = np.empty(n_sights, np.int64)
    for own in clusters.sights:
        if own:
            labels[own] = min(own)
    return np.unique(labels, return_inverse=True)[1].astype(np.int64)


def _bits(mask: int) -> Iterator[int]:
    while mask:
        lowest = mask & -mask
        yield lowest.bit_length() - 1
        mask ^= lowest
