"""Which boxes are right, and what is made of that."""

import numpy as np
import pytest

from pomona.detect import Detections
from pomona.detect.accuracy import Found, judged, overlaps

NONE = np.empty((0, 4))


def found(boxes, scores, truth, ignored=NONE):
    return Found(Detections(np.array(boxes, float).reshape(-1, 4), np.array(scores)), np.array(truth, float), ignored)


def test_a_fruit_is_found_once_and_by_the_best_box():
    picture = found([[0, 0, 10, 10], [1, 0, 11, 10], [50, 50, 60, 60]], [0.5, 0.9, 0.7], [[0, 0, 10, 10]])
    result = judged([picture])
    assert result.scores.tolist() == [0.9, 0.7, 0.5]
    assert result.right.tolist() == [True, False, False]
    assert result.n_fruits == 1


def test_what_is_ignored_is_neither_right_nor_wrong():
    ignored = np.array([[50, 50, 60, 60]])
    result = judged([found([[0, 0, 10, 10], [50, 50, 60, 60]], [0.5, 0.9], [[0, 0, 10, 10]], ignored)])
    assert result.scores.tolist() == [0.5]
    assert result.average_precision == pytest.approx(1.0)


def test_average_precision_and_recalls_of_a_known_order():
    # Right, wrong, right of 4 fruits: precision 1, 1/2, 2/3 at recall 1/4, 1/4, 1/2.
    truth = [[0, 0, 10, 10], [20, 0, 30, 10], [40, 0, 50, 10], [60, 0, 70, 10]]
    result = judged([found([truth[0], [80, 0, 90, 10], truth[1]], [0.9, 0.8, 0.7], truth)])
    assert result.average_precision == pytest.approx(1 / 4 + 2 / 3 / 4)
    assert result.recall_at(0.9) == pytest.approx(0.25)
    assert result.recall_at(0.6) == pytest.approx(0.5)
    assert result.above(0.8) == (0.5, 0.25)


def test_the_score_of_the_right_count_leaves_as_many_boxes_as_fruits():
    truth = [[0, 0, 10, 10], [20, 0, 30, 10]]
    result = judged([found([truth[0], [80, 0, 90, 10], truth[1]], [0.9, 0.8, 0.7], truth)])
    assert (result.scores >= result.score_of_right_count()).sum() == 2


def test_nothing_found_and_nothing_there():
    result = judged([found([], [], NONE)])
    assert (result.average_precision, result.recall_at(0.9), result.above(0.5)) == (0.0, 0.0, (0.0, 0.0))


def test_overlaps_are_intersection_over_union():
    assert overlaps(np.array([[0.0, 0, 10, 10]]), np.array([[5.0, 0, 15, 10], [20, 20, 30, 30]])).tolist() == [
        [pytest.approx(1 / 3), 0.0]
    ]
