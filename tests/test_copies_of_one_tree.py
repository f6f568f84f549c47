"""Rows of copies of one tree, each fruit some centimetres from where it hangs on the others."""

import numpy as np
import pytest
from numpy.typing import NDArray

import pomona
from pomona.synth.rotations import uniform_rotation

Array = NDArray[np.float64]


class Copies:
    """Eight trees of 25 to 59 fruits, 1.5 to 3 m apart; a visit sees four in five fruits of some, 1 cm off."""

    def __init__(self, seed: int, scatter_m: float) -> None:
        self.random = np.random.default_rng(seed)
        n_fruits, self.spacing_m = int(self.random.integers(25, 60)), self.random.uniform(1.5, 3.0)
        inside = self.random.uniform(-1.0, 1.0, (10 * n_fruits, 3))
        inside = inside[(inside**2).sum(axis=1) < 1.0][:n_fruits]
        one = inside * [0.35 * self.spacing_m, 0.6, 0.9]
        self.trees = [one + self.random.normal(0.0, scatter_m, one.shape) for _ in range(8)]

    def visit(self, trees: range) -> tuple[Array, NDArray[np.int64]]:
        """Return fruits in a frame of their own, and which they are."""
        fruits = np.concatenate([self.trees[tree] + [tree * self.spacing_m, 0.0, 1.5] for tree in trees])
        which = np.concatenate([1000 * tree + np.arange(len(self.trees[tree])) for tree in trees])
        is_seen = self.random.random(len(fruits)) < 0.8
        seen = fruits[is_seen] + self.random.normal(0.0, 0.01, (is_seen.sum(), 3))
        turned = seen @ uniform_rotation(self.random).T + self.random.uniform(-5.0, 5.0, 3)
        return turned, which[is_seen]


@pytest.mark.parametrize(("seed", "scatter_m"), [(6, 0.05), (7, 0.05), (22, 0.05), (7, 0.08), (58, 0.08)])
def test_trees_are_not_found_in_their_copies(seed: int, scatter_m: float) -> None:
    """Of which no fruit is in both; one way round or the other they were answered."""
    row = Copies(seed, scatter_m)
    (query, _), (known, _) = row.visit(range(4)), row.visit(range(4, 8))
    assert "Found" not in (pomona.match(query, known).status, pomona.match(known, query).status)


@pytest.mark.parametrize("scatter_m", [0.03, 0.05, 0.08])
def test_the_same_trees_are_found_among_copies(scatter_m: float) -> None:
    row = Copies(0, scatter_m)
    (query, seen), (known, shown) = row.visit(range(4)), row.visit(range(4))
    found = pomona.match(query, known)
    assert found.status == "Found"
    assert np.mean([seen[one] == shown[other] for one, other in found.pairs]) > 0.97
