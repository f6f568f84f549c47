"""Visits of which nobody knows from which side they looked."""

from dataclasses import replace

import numpy as np
import pytest

from pomona.identity.histories import histories_of
from pomona.identity.lives import lives_of
from pomona.identity.local_shares import fruits_about
from pomona.identity.looks import Looks
from pomona.identity.sides import sided

N_FRUITS = 260


def looks_of(seen: np.ndarray, rng: np.random.Generator) -> Looks:
    """Looks at all fruits, without frames that are counted, without sides."""
    everywhere = np.ones(seen.shape, bool)
    unknown = np.full((*seen.shape, 3), np.nan)
    about = fruits_about(rng.random((len(seen), 3)) * [8.0, 1.0, 2.0])
    none = np.zeros(seen.shape)
    return Looks(seen, everywhere, 0.5 * seen, unknown, np.zeros(seen.shape[1], bool), none, everywhere, about)


def from_sides(sides: str, rng: np.random.Generator) -> Looks:
    """A crown: what hangs towards a visit is seen nine times in ten, what hangs beyond once in eight; 5 % false."""
    depth = rng.uniform(-0.5, 0.5, N_FRUITS)
    seen = np.empty((N_FRUITS, len(sides)), bool)
    for visit, side in enumerate(sides):
        towards = depth * (1.0 if side == "A" else -1.0)
        chance = np.where(towards > 0.12, 0.92, np.where(towards > -0.12, 0.45, 0.12))
        seen[:, visit] = rng.random(N_FRUITS) < chance
    false = [visit for visit in range(len(sides)) for _ in range(round(0.05 * seen[:, visit].sum()))]
    points = np.array(false)[:, None] == np.arange(len(sides))
    return looks_of(np.concatenate([seen[seen.any(axis=1)], points]), rng)


def counted(looks: Looks) -> float:
    lives = lives_of(histories_of(looks, 14.0 * np.arange(looks.seen.shape[1])))
    return float(((1.0 - lives.false) * (1.0 - lives.gone)).sum())


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("sides", ["AAAB", "AAABB", "ABAB", "ABBA"])
def test_a_visit_from_the_other_side_neither_takes_nor_makes_fruits(sides: str, seed: int) -> None:
    looks = from_sides(sides, np.random.default_rng(seed))
    told = sided(looks, 14.0 * np.arange(len(sides)))
    assert counted(told) == pytest.approx(N_FRUITS, rel=0.1)


@pytest.mark.parametrize("sides", ["AAAB", "ABBA", "ABAB", "AABBABAB"])
def test_visits_of_one_side_are_told_by_what_they_see_alike(sides: str) -> None:
    looks = from_sides(sides, np.random.default_rng(3))
    told = sided(looks, 14.0 * np.arange(len(sides)))
    assert told.towards[0, :, 1].tolist() == [1.0 if side == "A" else -1.0 for side in sides]


def test_one_visit_of_six_is_told_though_all_see_what_hangs_free() -> None:
    """All visits agree with each other, those of one side more."""
    n_told = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        depth = rng.uniform(0.0, 1.0, N_FRUITS)
        hidden = 2.0 * np.stack([depth, 1.0 - depth], axis=1) + rng.normal(size=(N_FRUITS, 2))
        seen = rng.logistic(scale=0.8, size=(N_FRUITS, 6)) < 1.6 - hidden[:, [0, 0, 0, 0, 0, 1]]
        looks = looks_of(seen[seen.any(axis=1)], rng)
        told = sided(looks, 14.0 * np.arange(6))
        if told is not looks:
            n_told += 1
            assert told.towards[0, :, 1].tolist() == [1.0, 1.0, 1.0, 1.0, 1.0, -1.0]
            assert counted(told) == pytest.approx(seen.any(axis=1).sum(), rel=0.06)
    assert n_told >= 8


def test_without_sides_the_same_visits_count_far_too_few() -> None:
    """Were it not so, nobody would need sides."""
    looks = from_sides("AAAB", np.random.default_rng(0))
    assert counted(looks) < 0.75 * N_FRUITS


@pytest.mark.parametrize("left", [0.3, 0.5, 1.0])
@pytest.mark.parametrize("when", [1, 2, 3])
def test_what_was_thinned_is_no_other_side(left: float, when: int) -> None:
    rng = np.random.default_rng(7)
    hangs = rng.random(N_FRUITS) < left
    seen = rng.random((N_FRUITS, 4)) < 0.85
    seen[:, when:] &= hangs[:, None]
    looks = looks_of(seen[seen.any(axis=1)], rng)
    assert sided(looks, 14.0 * np.arange(4)) is looks


@pytest.mark.parametrize("known", [(0,), (3,), (0, 1, 2), (1, 2, 3), (0, 3)])
def test_sides_that_are_known_stay_and_tell_of_the_others(known: tuple[int, ...]) -> None:
    """One visit with cameras must not take from the others that they agree with it, or do not."""
    sides, rng = "AAAB", np.random.default_rng(0)
    looks = from_sides(sides, rng)
    towards = looks.towards.copy()
    for visit in known:
        towards[:, visit] = [0.6, 0.8 if sides[visit] == "A" else -0.8, 0.0]
    some = replace(looks, towards=towards)
    told = sided(some, 14.0 * np.arange(4))
    np.testing.assert_array_equal(told.towards[:, known], towards[:, known])
    cosines = np.einsum("kvi,kwi->kvw", told.towards, told.towards)
    alike = np.array([[one == other for other in sides] for one in sides])
    assert (cosines[:, alike] > 0.5).all()
    assert (cosines[:, ~alike] < 0.5).all()
    assert counted(told) == pytest.approx(N_FRUITS, rel=0.1)


def test_where_all_sides_are_known_they_stay() -> None:
    looks = from_sides("AAAB", np.random.default_rng(0))
    known = replace(looks, towards=np.tile([0.0, 1.0, 0.0], (*looks.seen.shape, 1)))
    assert sided(known, 14.0 * np.arange(4)) is known
