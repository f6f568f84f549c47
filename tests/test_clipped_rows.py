"""Rows on wires whose clips were taken for fruits: a pattern that all rows of a block share."""

import numpy as np
import pytest
from numpy.typing import NDArray

import pomona

TREES_M = 1.2


def row(rng: np.random.Generator, trees: int, step_m: float) -> NDArray[np.float64]:
    """Forty fruits a tree, two and two, and a clip each so many metres on four wires."""
    of_trees = TREES_M * np.repeat(np.arange(trees), 20)
    count = len(of_trees)
    twos = np.column_stack(
        [of_trees + 0.3 * rng.normal(size=count), 0.3 * rng.normal(size=count), rng.uniform(0.5, 3.0, count)]
    )
    fruits = np.repeat(twos, 2, axis=0) + 0.06 * rng.normal(size=(2 * count, 3))
    along, height = (of.ravel() for of in np.meshgrid(np.arange(0, TREES_M * trees, step_m), [0.6, 1.2, 1.8, 2.4]))
    clips = np.column_stack([along, np.zeros(len(along)), height])
    return np.vstack([fruits, clips + 0.005 * rng.normal(size=clips.shape)])


def seen(rng: np.random.Generator, of: NDArray[np.float64]) -> NDArray[np.float64]:
    """Seven in ten of a row, 1.4 cm off."""
    those = of[rng.random(len(of)) < 0.7]
    return those + 0.014 * rng.normal(size=those.shape)


@pytest.mark.parametrize("seed", [3, 5, 16, 26, 44, 49, 56])
def test_rows_that_have_only_the_steps_of_their_clips_in_common_are_no_answer(seed: int) -> None:
    rng = np.random.default_rng(seed)
    query, known = seen(rng, row(rng, 5, 0.5)), seen(rng, row(rng, 10, 0.5))
    assert pomona.match(query, known).status == "NoMatch"


@pytest.mark.parametrize(("step_m", "seed"), [(0.25, 0), (0.25, 7), (0.25, 11), (0.25, 28), (0.5, 11), (0.5, 22)])
def test_a_stretch_of_another_row_is_no_part_by_its_clips(step_m: float, seed: int) -> None:
    """Half a row, and behind it half of one that is not in the map, as much off as a camera that lost its way."""
    rng = np.random.default_rng(seed)
    whole, other = row(rng, 10, step_m), row(rng, 5, step_m)
    half = seen(rng, whole)
    half = half[half[:, 0] < 5 * TREES_M]
    cos, sin = np.cos(turn := rng.uniform(-0.3, 0.3)), np.sin(turn)
    turned = seen(rng, other) @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    off = np.array([5 * TREES_M + rng.uniform(0.5, 2.0), rng.uniform(-1.0, 1.0), rng.uniform(-0.1, 0.1)])
    answer = pomona.match(np.vstack([half, turned + off]), seen(rng, whole))
    assert answer.status == "Found"
    assert answer.n_parts == 1
    of_other = answer.pairs[:, 0] >= len(half)
    assert (~of_other).sum() > 100
    assert not (answer.probabilities[of_other] > 0.9).any()
