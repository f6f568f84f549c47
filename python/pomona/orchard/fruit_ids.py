"""Identities over the life of a map: a fruit keeps its id while it can, and no id is given out twice."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["Change", "Event", "changes_between", "ids_of_clusters"]

Event = Literal["joined", "split", "moved"]


@dataclass(frozen=True)
class Change:
    """Observations that later evidence gave to another fruit.

    Attributes
    ----------
    event : {"joined", "split", "moved"}
        All of a fruit came to another one; some became one of their own; some went to another one.
    from_fruit_id, to_fruit_id : int
    n_observations : int
    """

    event: Event
    from_fruit_id: int
    to_fruit_id: int
    n_observations: int


def ids_of_clusters(labels: NDArray[np.int64], before: NDArray[np.int64], last_id: int) -> NDArray[np.int64]:
    """Return the id of each cluster, (K,).

    An id goes with most of its sights; of equal ones the older id goes first. Clusters without one get the next.

    Parameters
    ----------
    labels : (S,) int64
        Cluster of each sight.
    before : (S,) int64
        Id of each sight, 0 where it has none.
    last_id : int
        The last that was given out.
    """
    ids = np.zeros(int(labels.max(initial=-1)) + 1, np.int64)
    shared = Counter(zip(before.tolist(), labels.tolist(), strict=True))
    taken = {0}
    for (fruit_id, cluster), _ in sorted(shared.items(), key=lambda item: (-item[1], item[0])):
        if fruit_id not in taken and not ids[cluster]:
            ids[cluster] = fruit_id
            taken.add(fruit_id)
    without = np.flatnonzero(ids == 0)
    ids[without] = last_id + 1 + np.arange(len(without))
    return ids


def changes_between(before: NDArray[np.int64], after: NDArray[np.int64], last_id: int) -> list[Change]:
    """Return what became of the sights that had an id, (S,), in order of ids."""
    still_there = set(after.tolist())
    moved = Counter(
        (one, other) for one, other in zip(before.tolist(), after.tolist(), strict=True) if one and one != other
    )
    return [
        Change(_event(one in still_there, other > last_id), one, other, count)
        for (one, other), count in sorted(moved.items())
    ]


def _event(is_still_there: bool, is_new: bool) -> Event:
    if not is_still_there:
        return "joined"
    return "split" if is_new else "moved"
