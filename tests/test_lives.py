"""What visits that looked and did not see say of fruits."""

import numpy as np
import pytest

from pomona.identity.lives import SHARE_FALSE, lives_of


def test_after_one_visit_its_fruits_are_fruits_but_for_the_usual_share():
    """Nobody has looked a second time: the visit says nothing but what is known of visits."""
    seen = np.ones((130, 1), bool)
    lives = lives_of(seen, np.full((130, 1), 0.15))
    assert lives.false == pytest.approx(np.full(130, SHARE_FALSE), abs=1e-6)
    assert lives.gone == pytest.approx(np.zeros(130), abs=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3])
def test_the_share_of_false_points_is_that_of_fruits_seen_alone_beyond_those_that_hide(share):
    rng = np.random.default_rng(3)
    real = rng.random((1000, 3)) > 0.2
    real = real[real.any(axis=1)]
    false = np.eye(3, dtype=bool)[rng.integers(0, 3, round(share * 800 * 3))]
    seen = np.concatenate([real, false])
    found = lives_of(seen, np.full(seen.shape, 0.2)).false
    expected = len(false) / seen.sum()
    assert found.sum() / seen.sum() == pytest.approx(expected, abs=0.03)
    assert not found[seen.sum(axis=1) > 1].any()
