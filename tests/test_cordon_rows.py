"""Rows of one wire: bunches at nearly equal distances, as near the wire as they are near each other."""

import numpy as np
import pytest
from numpy.typing import NDArray

import pomona
from pomona.synth.rotations import uniform_rotation

LENGTH_M = 12.0


def bunches(rng: np.random.Generator) -> NDArray[np.float64]:
    """A bunch a spur, nine in ten of them there, spurs 9 cm apart and bunches 3 cm about the wire."""
    along = np.cumsum(rng.normal(0.09, 0.01, int(LENGTH_M / 0.09)))
    along = along[rng.random(len(along)) < 0.9]
    return np.stack([along, np.zeros_like(along), np.full_like(along, 0.85)], axis=1) + rng.normal(
        0, [0.012, 0.03, 0.025], (len(along), 3)
    )


def visit(rng: np.random.Generator, row: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """What a visit sees of a row, and which bunches these are; -1 for what is none."""
    which = np.flatnonzero(rng.random(len(row)) < 0.7)
    false = np.stack([rng.uniform(0, LENGTH_M, 14), np.zeros(14), np.full(14, 0.85)], axis=1)
    seen = np.vstack([row[which], false + rng.normal(0, 0.05, false.shape)])
    return seen + rng.normal(0, 0.01, seen.shape), np.concatenate([which, np.full(len(false), -1)])


def pair(seed: int, *, same: bool) -> tuple[pomona.Match, float]:
    """The match of two visits to one row or to two, and the share of its pairs that are right."""
    rng = np.random.default_rng(seed)
    first = bunches(rng)
    before, known = visit(rng, first)
    after, seen = visit(rng, first if same else bunches(rng))
    match = pomona.match(after @ uniform_rotation(rng).T + rng.uniform(-5, 5, 3), before)
    right = [seen[query] == known[row] >= 0 for query, row in match.pairs]
    return match, float(np.mean(right)) if right else 0.0


def test_rows_of_one_wire_are_found() -> None:
    """A half of what either visit sees is in the other; the wire is no line to visits that tell a centimetre."""
    found = [right for match, right in (pair(seed, same=True) for seed in range(20)) if match]
    assert len(found) >= 18
    assert min(found) > 0.8


@pytest.mark.parametrize("first", [0, 20])
def test_rows_of_one_wire_are_not_found_in_others(first: int) -> None:
    assert not any(pair(seed, same=False)[0] for seed in range(first, first + 20))
