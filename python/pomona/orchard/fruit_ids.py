"""Identities over the life of a map: a fruit keeps its id while it can, and no id is given out twice."""

from __future__ import annotations

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
    one, other, counts = _counted(before, labels)
    order = np.argsort(-counts, kind="stable")
    taken = {0}
    for fruit_id, cluster in zip(one[order].tolist(), other[order].tolist(), strict=True):
        if fruit_id not in taken and not ids[cluster]:
            ids[cluster] = fruit_id
            taken.add(fruit_id)
    without = np.flatnonzero(ids == 0)
    ids[without] = last_id + 1 + np.arange(len(without))
    return ids


def changes_between(before: NDArray[np.int64], after: NDArray[np.int64], last_id: int) -> list[Change]:
    """Return what became of the sights that had an id, (S,), in order of ids."""
    still_there = set(after.tolist())
    moved = (before != 0) & (before != after)
    return [
        Change(_event(one in still_there, other > last_id), one, other, count)
        for one, other, count in zip(
            *(column.tolist() for column in _counted(before[moved], after[moved])), strict=True
        )
    ]


def _counted(
    first: NDArray[np.int64], second: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the pairs that are there, in order, one side and the other, and how often each is."""
    order = np.lexsort((second, first))
    one, other = first[order], second[order]
    is_new = np.concatenate([[True], (one[1:] != one[:-1]) | (other[1:] != other[:-1])])[: len(one)]
    starts = np.flatnonzero(is_new)
    return one[starts], other[starts], np.diff(starts, append=len(one))


def _event(is_still_there: bool, is_new: bool) -> Event:
    if not is_still_there:
        return "joined"
    return "split" if is_new else "moved"
