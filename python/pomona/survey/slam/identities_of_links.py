"""Which sightings are one fruit, by the pairs of all links: surest first, a fruit once in a frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.survey.slam.constellation_links import ConstellationLink

__all__ = ["joined_fruits", "linked_fruits", "pairs_of"]

Rows = NDArray[np.int64]

SURE = 0.5
"""Probability from which on two sightings are taken for one fruit."""


def linked_fruits(links: Sequence[ConstellationLink], begins: Rows, frames: Rows) -> Rows:
    """Give the fruit of each sighting, (S,), numbered from 0 in order of time.

    Parameters
    ----------
    links : sequence of ConstellationLink
        Those that are believed.
    begins : (F,) int64
        First sighting of each frame.
    frames : (S,) int64
        Frame of each sighting.
    """
    return joined_fruits(np.arange(len(frames)), frames, pairs_of(links, begins))


def pairs_of(links: Sequence[ConstellationLink], begins: Rows) -> list[tuple[int, int]]:
    """Give the two sightings of each pair of fruits that links are sure of, the surest first."""
    pairs = [
        (-probability, int(begins[link.first] + row), int(begins[link.second] + other))
        for link in links
        for (row, other), probability in zip(link.pairs.tolist(), link.probabilities.tolist(), strict=True)
        if probability > SURE
    ]
    return [(one, other) for _, one, other in sorted(pairs)]


def joined_fruits(fruits: Rows, frames: Rows, pairs: Iterable[Sequence[int]]) -> Rows:
    """Join fruits, named by one sighting each, unless some frame saw both.

    Parameters
    ----------
    fruits : (S,) int64
        Fruit of each sighting so far.
    frames : (S,) int64
        Frame of each sighting.
    pairs : iterable of pairs of int
        Sightings of the same fruit, in the order in which they are believed.
    """
    owner = list(range(int(fruits.max(initial=-1)) + 1))
    seen_in: list[set[int]] = [set() for _ in owner]
    for fruit, frame in zip(fruits.tolist(), frames.tolist(), strict=True):
        seen_in[fruit].add(frame)
    for one, other in pairs:
        first, second = sorted((_root(owner, int(fruits[one])), _root(owner, int(fruits[other]))))
        if first != second and not seen_in[first] & seen_in[second]:
            owner[second] = first
            seen_in[first] |= seen_in[second]
    roots = [_root(owner, fruit) for fruit in fruits.tolist()]
    return np.unique(np.array(roots, np.int64), return_inverse=True)[1]


def _root(owner: list[int], fruit: int) -> int:
    while owner[fruit] != fruit:
        owner[fruit] = owner[owner[fruit]]
        fruit = owner[fruit]
    return fruit
