"""Boxes that cannot be right: on each other, halves of a fruit, around two fruits."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pomona.cloud import FruitCloud
from pomona.errors import PomonaWarning
from pomona.recording import Calibration
from pomona.survey.box_check import check_boxes, check_long_boxes, check_places_of_boxes
from pomona.survey.part import Boxes, Part
from pomona.trajectory import Trajectory

CAMERA = Calibration(width=640, height=480, fx=500.0, fy=500.0, cx=320.0, cy=240.0)


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


def row_of(*shapes: tuple[float, float], frames: int = 12) -> list[list[list[float]]]:
    """Boxes so wide and high one beside the other, 200 px apart, in frames alike."""
    boxes = [[200.0 * n, 50, 200 * n + width, 50 + height] for n, (width, height) in enumerate(shapes)]
    return [boxes] * frames


def cut(box: list[float], gap_px: float) -> list[list[float]]:
    middle = (box[1] + box[3]) / 2
    return [[*box[:3], middle - gap_px / 2], [box[0], middle + gap_px / 2, *box[2:]]]


@pytest.mark.parametrize("gap_px", [-4.0, 0.0, 6.0])
def test_halves_of_fruits_are_told(gap_px: float) -> None:
    whole = row_of((40, 42), (35, 38), (50, 48), (40, 40))
    halved = [[*cut(frame[0], gap_px), *frame[1:]] for frame in whole]
    check_boxes(Path("row"), [of_frames(*whole)])
    with pytest.warns(PomonaWarning, match="24 of 60 boxes make one square with the box beside them"):
        check_boxes(Path("row"), [of_frames(*halved)])


def test_fruits_that_touch_are_no_halves() -> None:
    touching = [[10.0, 10, 50, 52], [50, 10, 90, 50], [200, 10, 240, 50], [200, 50, 240, 90]]
    check_boxes(Path("row"), [of_frames(*[touching] * 12)])


def surveyed(*shapes: tuple[float, float]) -> Part:
    """Fruits of 8 cm two metres ahead, 20 px wide, in boxes so wide and high."""
    boxes = of_frames(*row_of(*shapes))
    n = len(shapes)
    boxes = Boxes(boxes.frames, boxes.boxes_px, boxes.scores, np.tile(np.arange(n), 12))
    places = np.column_stack([np.linspace(-0.5, 0.5, n), np.zeros(n), np.full(n, 2.0)])
    poses = np.tile(np.eye(4), (12, 1, 1))
    cloud = FruitCloud(places, diameters_m=np.full(n, 0.08))
    return Part(cloud, Trajectory(np.arange(12), np.arange(12.0), poses), boxes)


def test_boxes_around_two_fruits_are_told() -> None:
    part = surveyed((20, 21), (38, 20), (21, 20), (20, 20))
    with pytest.warns(PomonaWarning, match="12 of 48 boxes of fruits are long as two of them and not as wide"):
        check_long_boxes(Path("row"), CAMERA, [part])


def test_large_fruits_and_those_behind_leaves_are_single() -> None:
    check_long_boxes(Path("row"), CAMERA, [surveyed((20, 21), (32, 30), (10, 20), (26, 20))])
    check_long_boxes(Path("row"), CAMERA, [])


def test_boxes_that_are_not_where_their_fruits_are_are_told() -> None:
    """Boxes with names of another date were scanned without a word: places, sizes and counts looked right."""
    seen = surveyed((20, 20), (20, 21), (21, 20), (20, 22))
    at_px = CAMERA.fx * seen.cloud.positions[:, 0] / 2.0 + CAMERA.cx
    row_px = np.full(4, CAMERA.cy)
    boxes_px = np.tile(np.column_stack([at_px - 10, row_px - 10, at_px + 10, row_px + 10]), (12, 1))
    right = replace(seen.boxes, boxes_px=boxes_px)
    check_places_of_boxes(Path("row"), CAMERA, [replace(seen, boxes=right)])
    check_places_of_boxes(Path("row"), CAMERA, [])
    strange = replace(seen, boxes=replace(right, boxes_px=boxes_px + 50.0))
    with pytest.warns(
        PomonaWarning, match=r"boxes are 3\.5 times their size from where their fruits lie, in the median"
    ):
        check_places_of_boxes(Path("row"), CAMERA, [strange])
