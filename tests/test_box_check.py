"""Boxes of one frame that lie on each other."""

from pathlib import Path

import numpy as np
import pytest

from pomona.errors import PomonaWarning
from pomona.survey.box_check import check_boxes
from pomona.survey.part import Boxes


def of_frames(*frames: list[list[float]]) -> Boxes:
    numbers = np.repeat(np.arange(len(frames)), [len(boxes) for boxes in frames])
    boxes_px = np.array([box for boxes in frames for box in boxes], np.float64)
    return Boxes(numbers, boxes_px, np.ones(len(numbers)), np.full(len(numbers), -1))


def test_every_box_twice_is_told() -> None:
    twice = [[10, 10, 30, 30], [10.5, 9.5, 30, 31], [50, 50, 80, 80], [50, 50, 80, 81]]
    with pytest.warns(PomonaWarning, match=r"8 of 8 boxes share 80% or more .* suppress such pairs"):
        check_boxes(Path("row"), [of_frames(twice, twice)])


def test_neighbours_and_the_next_frame_are_not() -> None:
    row = [[10.0, 10, 30, 30], [18, 10, 38, 30], [50, 50, 80, 80]]
    check_boxes(Path("row"), [of_frames(row, row)])
