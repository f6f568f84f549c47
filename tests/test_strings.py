"""Fruits on strings that hang down: what hangs beside a fruit lies along its string, and is not that fruit moved."""

import numpy as np
import pytest
from numpy.typing import NDArray

import pomona

Array = NDArray[np.float64]

TREES, STRINGS, PITCH_M = 20, 10, 0.045
ROWS = range(6)
HIDDEN, NOISE_M = 0.25, 0.014


def strings(rng: np.random.Generator, lean: float) -> Array:
    """Ten strings a tree of four to eight fruits at one pitch, which lean by so much."""
    hanging = []
    for tree in range(TREES):
        for _ in range(STRINGS):
            foot = (0.5 * tree + rng.uniform(-0.25, 0.25), rng.normal(0, 0.12), rng.uniform(0.6, 2.4))
            way = np.array([0.0, 0.0, -1.0]) + rng.normal(0, lean, 3)
            steps = PITCH_M * np.arange(rng.integers(4, 9))
            hanging.append(foot + steps[:, None] * way / np.linalg.norm(way))
    places = np.concatenate(hanging)
    return places + rng.normal(0, 0.006, places.shape)


def visit(rng: np.random.Generator, places: Array) -> tuple[Array, Array]:
    shown = np.flatnonzero(rng.random(len(places)) > HIDDEN)
    return shown, places[shown] + rng.normal(0, NOISE_M, (len(shown), 3))


@pytest.mark.parametrize("lean", [0.0, 0.17, 10.0])
def test_pairs_of_strings_are_as_right_as_they_say(lean: float) -> None:
    """A lean of ten lets each string point anywhere: nothing is common then that noise could be taken for."""
    n_sure, n_right, said, right, found, in_common = 0, 0, 0.0, 0, 0, 0
    for seed in ROWS:
        rng = np.random.default_rng(5100 + seed)
        places = strings(rng, lean)
        (on_map, map), (seen, query) = visit(rng, places), visit(rng, places)
        match = pomona.match(query, map, threads=1)
        assert match.status == "Found"
        is_right = seen[match.pairs[:, 0]] == on_map[match.pairs[:, 1]]
        is_sure = match.probabilities >= 0.9
        n_sure += np.count_nonzero(is_sure)
        n_right += np.count_nonzero(is_right & is_sure)
        said += match.probabilities.sum()
        right += np.count_nonzero(is_right)
        found += len(match.pairs)
        in_common += len(np.intersect1d(seen, on_map))
    assert n_sure > 300
    assert n_right / n_sure > 0.88
    assert abs(right - said) / found < 0.03
    assert right / in_common > 0.75
