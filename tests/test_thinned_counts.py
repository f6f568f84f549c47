"""Rows that were thinned before the last visit, or that it hardly saw: how many fruits hang, right after it."""

import numpy as np

from pomona.identity.histories import histories_of
from pomona.identity.lives import lives_of
from pomona.identity.local_shares import fruits_about
from pomona.identity.looks import Looks

N_FRUITS, DAYS_APART, SHARE_FALSE, DROP = 250, 10.0, 0.04, 0.01


def counted_and_true(seed: int, sides: str, thinned: float, dim: float = 1.0) -> tuple[float, int]:
    """Fruits by what the visits saw, and those that hang; a share was thinned before the last visit, or it was dim.

    Where it is, each of twenty frames sees a fruit by so much more rarely, and a visit those that five frames show.

    Leaves hide a fruit from either side by its depth and by chance, on each date mostly as on the others.
    """
    rng = np.random.default_rng([seed, 99])
    places = rng.random((N_FRUITS, 3)) * [8.0, 1.0, 2.0]
    depth = places[:, 1] - 0.5
    hides = {side: 1.3 * rng.normal(size=N_FRUITS) for side in "AB"}
    hangs = np.ones(N_FRUITS, bool)
    seen = np.zeros((N_FRUITS, len(sides)), bool)
    views = np.zeros(seen.shape)
    for visit, side in enumerate(sides):
        hangs &= rng.random(N_FRUITS) > (DROP if visit else 0.0)
        if visit == len(sides) - 1:
            hangs &= rng.random(N_FRUITS) >= thinned
        towards = depth if side == "A" else -depth
        chance = 1.0 / (1.0 + np.exp(-1.2 - 2.5 * towards - hides[side] - 0.7 * rng.normal(size=N_FRUITS)))
        seen[:, visit] = hangs & (rng.random(N_FRUITS) < chance)
        views[:, visit] = np.clip(chance + 0.1 * rng.normal(size=N_FRUITS), 0.05, 1.0)
        if dim < 1.0:
            share = chance / (chance + np.e * (1.0 - chance)) * (dim if visit == len(sides) - 1 else 1.0)
            frames = rng.binomial(20, share)
            seen[:, visit], views[:, visit] = hangs & (frames >= 5), frames / 20.0
    n_false = [rng.poisson(SHARE_FALSE * count) for count in seen.sum(axis=0)]
    false = np.repeat(np.arange(len(sides)), n_false)[:, None] == np.arange(len(sides))
    seen, places = (
        np.concatenate([seen, false]),
        np.concatenate([places, rng.random((len(false), 3)) * [8.0, 1.0, 2.0]]),
    )
    views = np.concatenate([views, rng.uniform(0.05, 0.6, false.shape)])
    known = seen.any(axis=1)
    lives = lives_of(histories_of(looks_of(places[known], seen[known], views[known], sides), days(sides)))
    return float(((1.0 - lives.false) * (1.0 - lives.gone)).sum()), int(hangs.sum())


def days(sides: str) -> np.ndarray:
    return DAYS_APART * np.arange(len(sides))


def looks_of(places: np.ndarray, seen: np.ndarray, views: np.ndarray, sides: str) -> Looks:
    ranks = np.zeros(seen.shape)
    for visit, those in enumerate(seen.T):
        ranks[those, visit] = (views[those, visit].argsort().argsort() + 0.5) / those.sum()
    towards = np.zeros((*seen.shape, 3))
    towards[..., 1] = [1.0 if side == "A" else -1.0 for side in sides]
    everywhere, counts = np.ones(seen.shape, bool), np.ones(len(sides), bool)
    return Looks(seen, everywhere, ranks, towards, counts, np.zeros(seen.shape), everywhere, fruits_about(places))


def errors(sides: str, thinned: float, dim: float = 1.0) -> np.ndarray:
    both = [counted_and_true(seed, sides, thinned, dim) for seed in range(12)]
    return np.array([counted / true - 1.0 for counted, true in both])


def test_fruits_that_are_thinned_between_two_sides_are_not_counted_on() -> None:
    """Before people were believed to thin once in ten times, one row of twelve counted 30 % too many."""
    off = errors("ABA", 0.3)
    assert abs(off.mean()) < 0.05
    assert np.abs(off).max() < 0.18


def test_where_nothing_is_thinned_as_many_are_counted() -> None:
    off = errors("ABA", 0.0)
    assert abs(off.mean()) < 0.05
    assert np.abs(off).max() < 0.1


def test_a_last_visit_in_the_dark_is_not_one_after_picking() -> None:
    """It sees of those that hang free as many as before: where fruits are picked as many of each go."""
    off = errors("AAAAAA", 0.0, dim=0.5)
    assert abs(off.mean()) < 0.15
    assert np.median(off) > -0.13
