"""Two looks at one picture: what they say together."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pomona.detect.onnx.two_looks import LEAST, agreed

NOTHING = np.zeros((0, 4)), np.zeros(0)
FAR_PX = 1000.0
"""No box is larger."""


def boxes(*rows):
    """Give corners and scores of rows of xmin, ymin, xmax, ymax, score."""
    all_rows = np.array(rows, float).reshape(-1, 5)
    return all_rows[:, :4], all_rows[:, 4]


def together(*scores):
    """Give the score that looks with such scores have together."""
    odds = [score / (1 - score) for score in scores]
    mean = np.sqrt(odds[0] * odds[1])
    return mean / (1 + mean)


def test_what_both_see_is_one_box_between_them_and_nearer_to_the_surer():
    boxes_px, scores = agreed(boxes((0, 0, 20, 20, 0.8)), boxes((2, 0, 22, 20, 0.4)), 0.6, FAR_PX, 0.0)
    assert boxes_px.tolist() == [[pytest.approx(0.4), 0, pytest.approx(20.4), 20]]
    assert scores.tolist() == [pytest.approx(together(0.8, 0.4))]


@pytest.mark.parametrize("turned", [False, True])
def test_what_one_of_them_does_not_see_counts_less(turned):
    looks = boxes((0, 0, 20, 20, 0.8), (50, 0, 70, 20, 0.3)), NOTHING
    boxes_px, scores = agreed(*(looks[::-1] if turned else looks), 0.6, FAR_PX, 0.0)
    assert boxes_px.tolist() == [[0, 0, 20, 20], [50, 0, 70, 20]]
    assert scores.tolist() == [pytest.approx(together(score, LEAST)) for score in (0.8, 0.3)]
    assert len(agreed(NOTHING, NOTHING, 0.6, FAR_PX, 0.0)[1]) == 0


def test_of_two_fruits_that_touch_each_has_its_own_box():
    first = boxes((0, 0, 20, 20, 0.9), (4, 0, 24, 20, 0.8))
    boxes_px, scores = agreed(first, boxes((4, 0, 24, 20, 0.7), (0, 0, 20, 20, 0.6)), 0.7, FAR_PX, 0.0)
    np.testing.assert_allclose(boxes_px, [[0, 0, 20, 20], [4, 0, 24, 20]])
    np.testing.assert_allclose(scores, [together(0.9, 0.6), together(0.8, 0.7)])


def test_of_a_large_fruit_the_first_look_alone_tells():
    first = boxes((0, 0, 80, 80, 0.7), (100, 0, 120, 20, 0.6))
    boxes_px, scores = agreed(first, boxes((1, 1, 81, 81, 0.2), (200, 0, 290, 80, 0.9)), 0.6, 60, 0.0)
    assert boxes_px.tolist() == [[0, 0, 80, 80], [100, 0, 120, 20]]
    np.testing.assert_allclose(scores, [0.7, together(0.6, LEAST)])


def test_boxes_below_the_least_score_are_left_out():
    first = boxes((0, 0, 20, 20, 0.9), (50, 0, 70, 20, 0.9))
    boxes_px, _ = agreed(first, boxes((50, 0, 70, 20, 0.8)), 0.6, FAR_PX, 0.5)
    np.testing.assert_allclose(boxes_px, [[50, 0, 70, 20]])


def test_certainty_is_no_error():
    _, scores = agreed(boxes((0, 0, 20, 20, 1.0)), boxes((0, 0, 20, 20, 1.0)), 0.6, FAR_PX, 0.0)
    assert scores[0] > 0.999
    _, scores = agreed(boxes((0, 0, 20, 20, 0.0)), boxes((0, 0, 20, 20, 1.0)), 0.6, FAR_PX, 0.0)
    assert scores.tolist() == [pytest.approx(0.5)]


def test_what_is_no_number_pairs_with_nothing():
    odd = boxes((np.nan, 0, 20, 20, 0.9), (0, 0, np.inf, 20, 0.9), (0, 0, 20, 20, 0.9))
    with np.errstate(all="ignore"):
        boxes_px, scores = agreed(odd, boxes((0, 0, 20, 20, 0.9)), 0.6, FAR_PX, 0.0)
    real = np.isfinite(boxes_px).all(axis=1)
    np.testing.assert_allclose(boxes_px[real], [[0, 0, 20, 20]])
    np.testing.assert_allclose(scores[real], [0.9])


corner = st.integers(0, 60)
box = st.tuples(corner, corner, st.integers(5, 30), st.integers(5, 30), st.floats(0.02, 0.99))


@given(st.lists(box, max_size=12), st.lists(box, max_size=12))
def test_boxes_lie_between_those_of_the_looks_and_none_is_there_twice(one, other):
    looks = [boxes(*((x, y, x + w, y + h, score) for x, y, w, h, score in rows)) for rows in (one, other)]
    boxes_px, scores = agreed(*looks, 0.6, FAR_PX, 0.0)
    assert len(scores) <= len(one) + len(other)
    assert (np.diff(scores) <= 0).all()
    given_px = np.concatenate([each for each, _ in looks])
    for row, found in enumerate(boxes_px):
        near = [each for each in given_px if overlap(found, each) >= 0.6]
        assert near
        assert all(overlap(found, each) <= 0.6 + 1e-9 for each in boxes_px[:row])


def overlap(one, other):
    """Intersection over union of two boxes."""
    shared = np.prod(np.maximum(np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2]), 0))
    return shared / (np.prod(one[2:] - one[:2]) + np.prod(other[2:] - other[:2]) - shared)
