"""All visits in one frame: each is laid onto the one nearest in time with which it matches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.identity.visits import SeenVisit, VisitPair

__all__ = ["frames_of_visits"]


def frames_of_visits(
    visits: Sequence[SeenVisit],
    pairs: Sequence[VisitPair],
    known: NDArray[np.float64],
    keepers: Sequence[int],
) -> NDArray[np.float64]:
    """Return `map_from_visit` of every visit, (V, 4, 4).

    Trees bend least between neighbouring dates, so the pairs nearest in time make the tree by which visits hang
    together; of equal ones those with the most evidence. A visit that is newer than all is a leaf of it and moves
    nobody.

    Parameters
    ----------
    visits, pairs
        The visits in order, and how they match.
    known
        Where each visit lies now, (V, 4, 4).
    keepers
        Numbers of the visits; of those that hang together the first of them stays where it is.
    """
    neighbours = _tree(visits, pairs)
    frames = known.copy()
    placed: set[int] = set()
    for keeper in keepers:
        waiting = [] if keeper in placed else [keeper]
        placed.update(waiting)
        while waiting:
            visit = waiting.pop()
            for other, visit_from_other in neighbours[visit]:
                if other not in placed:
                    frames[other] = frames[visit] @ visit_from_other
                    placed.add(other)
                    waiting.append(other)
    return frames


def _tree(visits: Sequence[SeenVisit], pairs: Sequence[VisitPair]) -> list[list[tuple[int, NDArray[np.float64]]]]:
    """Return for each visit those that hang on it, with their transforms into its frame (Kruskal's minimal tree)."""
    neighbours: list[list[tuple[int, NDArray[np.float64]]]] = [[] for _ in visits]
    together = list(range(len(visits)))
    for pair in sorted(pairs, key=lambda pair: _distance(visits, pair)):
        one, other = together[pair.first], together[pair.second]
        if one != other:
            together = [one if whose == other else whose for whose in together]
            neighbours[pair.first].append((pair.second, pair.first_from_second))
            neighbours[pair.second].append((pair.first, np.asarray(np.linalg.inv(pair.first_from_second), np.float64)))
    return neighbours


def _distance(visits: Sequence[SeenVisit], pair: VisitPair) -> tuple[float, float, int, int]:
    return visits[pair.second].day - visits[pair.first].day, -pair.log_odds, pair.first, pair.second
