"""Trees that were replaced between two visits: their fruits are not the old ones', however alike the trees are."""

import numpy as np
from numpy.typing import NDArray

import pomona

SPACING_M = 2.0


def stem(rng: np.random.Generator) -> NDArray[np.float64]:
    """A papaya: two dozen fruits in a spiral around a stem, nine in ten of them there."""
    steps = np.arange(rng.integers(14, 26))
    turns = rng.uniform(0, 6.3) + steps * rng.normal(2.36, 0.15) + rng.normal(0, 0.25, len(steps))
    away = rng.uniform(0.1, 0.18) + rng.normal(0, 0.03, len(steps))
    heights = rng.uniform(1.0, 1.7) + steps * rng.uniform(0.045, 0.075) + rng.normal(0, 0.02, len(steps))
    fruits = np.stack([away * np.cos(turns), away * np.sin(turns), heights], axis=1) + rng.normal(0, [0.06, 0.05, 0], 3)
    return fruits[rng.random(len(steps)) < 0.9]


def visits(seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Two visits to sixteen stems, and which of these were replaced between them: three in four."""
    rng = np.random.default_rng(seed)
    replaced = rng.permutation(16) >= 4
    old = [stem(rng) for _ in replaced]
    new = [stem(rng) if is_new else fruits for fruits, is_new in zip(old, replaced, strict=True)]
    seen = []
    for stems in (old, new):
        places = np.arange(len(stems))[:, None] * [SPACING_M, 0.0, 0.0]
        fruits = np.vstack([fruits + place for place, fruits in zip(places, stems, strict=True)])
        fruits = fruits[rng.random(len(fruits)) > 0.25]
        seen.append(fruits + rng.normal(0, 0.014, fruits.shape))
    return *seen, replaced


def test_stems_that_were_replaced_are_seldom_taken_for_the_old_ones() -> None:
    right = wrong = 0
    for seed in range(16):
        before, after, replaced = visits(seed)
        match = pomona.match(after, before)
        sure = match.pairs[match.probabilities >= 0.9]
        is_replaced = replaced[np.round(after[sure[:, 0], 0] / SPACING_M).astype(int)]
        wrong += int(is_replaced.sum())
        right += int((~is_replaced).sum())
    assert right > 480
    assert wrong < 0.05 * right
