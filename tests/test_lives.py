"""What visits that looked and did not see say of fruits."""

import numpy as np
import pytest

from pomona.identity.lives import CHANCES_OF_SEEING, SHARE_FALSE, lives_of

HIDDEN, FREE = 3, 10
"""Classes of visibility: of fruits deep in the leaves, and of those that hang free."""


def lives(seen, classes=FREE):
    return lives_of(seen, np.ones(seen.shape, bool), np.broadcast_to(np.asarray(classes), seen.shape))


def test_after_one_visit_its_fruits_are_fruits_but_for_the_usual_share():
    """Nobody has looked a second time: the visit says nothing but what is known of visits."""
    found = lives(np.ones((130, 1), bool))
    assert found.false == pytest.approx(np.full(130, SHARE_FALSE), abs=1e-6)
    assert found.gone == pytest.approx(np.zeros(130), abs=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3])
def test_the_share_of_false_points_is_that_of_fruits_seen_alone_beyond_those_that_hide(share):
    rng = np.random.default_rng(3)
    real = rng.random((1000, 3)) > 0.2
    real = real[real.any(axis=1)]
    false = np.eye(3, dtype=bool)[rng.integers(0, 3, round(share * 800 * 3))]
    seen = np.concatenate([real, false])
    found = lives(seen).false
    expected = len(false) / seen.sum()
    assert found.sum() / seen.sum() == pytest.approx(expected, abs=0.03)
    assert not found[seen.sum(axis=1) > 1].any()


def test_as_many_are_gone_as_have_gone_though_many_hide():
    """The share that goes and the chances of seeing are learnt from the same looks: none takes from the other."""
    rng = np.random.default_rng(8)
    hard = rng.random(4000) < 0.4
    hangs = np.cumsum(rng.random((4000, 5)) < [0.0, 0.04, 0.04, 0.04, 0.04], axis=1) == 0
    seen = hangs & (rng.random((4000, 5)) < np.where(hard, 0.4, 0.97)[:, None])
    met = seen.any(axis=1)
    found = lives(seen[met], np.where(hard[met], HIDDEN, FREE)[:, None])
    gone = ~hangs[met, -1]
    assert found.gone[hard[met]].mean() == pytest.approx(gone[hard[met]].mean(), abs=0.03)
    assert found.gone[~hard[met]].mean() == pytest.approx(gone[~hard[met]].mean(), abs=0.01)


def test_a_fruit_that_hung_free_is_gone_sooner_than_one_that_hid():
    seen = np.array([[True, True, False], [True, True, False], *[[True, True, True]] * 30])
    free, hidden = lives(seen, np.array([FREE, HIDDEN, *[FREE] * 30])[:, None]).gone[:2]
    assert free > 0.5 > hidden
    assert len(CHANCES_OF_SEEING) == FREE + 1
