"""Stems that stand apart and whose fruits hang in one spiral, each turned as it likes: any lies on any other."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import pomona
from pomona.synth.rotations import uniform_rotation

N_STEMS = 24


def stems(rng: np.random.Generator) -> NDArray[np.float64]:
    """A row of them, a metre apart, with 12 to 17 fruits each; a fruit is a centimetre off the spiral."""
    row = []
    for stem in range(N_STEMS):
        n = int(rng.integers(12, 18))
        turn = rng.uniform(0.0, 2.0 * np.pi) + 1.9 * np.arange(n) + rng.normal(0.0, 0.1, n)
        up = rng.uniform(1.4, 2.0) + 0.06 * np.arange(n) + rng.normal(0.0, 0.01, n)
        foot = [stem + rng.normal(0.0, 0.15), rng.normal(0.0, 0.1), 0.0]
        row.append(np.stack([0.11 * np.cos(turn), 0.11 * np.sin(turn), up], axis=1) + foot)
    return np.concatenate(row)


def visit(rng: np.random.Generator, row: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Three fruits in four, 8 mm off; and which they are."""
    which = np.flatnonzero(rng.random(len(row)) < 0.75)
    return row[which] + rng.normal(0.0, 0.008, (len(which), 3)), which


def bunches(rng: np.random.Generator) -> NDArray[np.float64]:
    """A dozen bunches of 6 to 10 hands, no two alike: steps, turns and widths differ, and each leans its own way."""
    row = []
    for bunch in range(12):
        n = int(rng.integers(6, 11))
        turn = rng.uniform(0.0, 2.0 * np.pi) + np.cumsum(rng.normal(2.1, 0.4, n))
        down, out = np.cumsum(rng.uniform(0.09, 0.16, n)), rng.uniform(0.12, 0.2, n)
        lean = rng.normal(0.0, 0.15, 2)
        top = [2.4 * bunch + rng.normal(0.0, 0.2), rng.normal(0.0, 0.2), 2.4 + rng.normal(0.0, 0.25)]
        hands = np.stack([out * np.cos(turn) + lean[0] * down, out * np.sin(turn) + lean[1] * down, -down], axis=1)
        row.append(hands + top)
    return np.concatenate(row)


Planting = Callable[[np.random.Generator], NDArray[np.float64]]


def match(seed: int, *, same: bool, of: Planting = stems) -> tuple[pomona.Match, NDArray[np.bool_]]:
    """The match of two visits to one row or to two, and which of its pairs are right."""
    rng = np.random.default_rng(seed)
    row = of(rng)
    before, known = visit(rng, row)
    after, seen = visit(rng, row if same else of(rng))
    found = pomona.match(after @ uniform_rotation(rng).T + rng.uniform(-5.0, 5.0, 3), before)
    return found, np.array([seen[query] == known[row] for query, row in found.pairs], bool)


@pytest.mark.parametrize("first", [0, 6])
def test_a_stem_that_lies_on_another_is_no_answer(first: int) -> None:
    """What stems have in common came as parts of a torn row, in any order, each turned otherwise."""
    assert not any(match(seed, same=False)[0] for seed in range(first, first + 6))


def test_the_row_is_found_and_no_stem_on_another() -> None:
    for seed in range(6):
        found, right = match(seed, same=True)
        assert found
        assert right[found.probabilities >= 0.9].mean() > 0.98


def test_two_bunches_that_stand_to_each_other_as_two_others_are_no_answer() -> None:
    """Each lies on others with more evidence: 12 of these 80 pairs were found, by the hands of a few bunches; now 4."""
    assert sum(bool(match(seed, same=False, of=bunches)[0]) for seed in range(300, 380)) <= 5


def test_a_row_of_bunches_is_found() -> None:
    for seed in range(20):
        found, right = match(seed, same=True, of=bunches)
        assert found
        assert right[found.probabilities >= 0.9].mean() > 0.97
