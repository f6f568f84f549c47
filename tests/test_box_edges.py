"""Boxes that are larger or smaller than the fruits in the pictures are told."""

import csv
import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pomona.errors import PomonaWarning
from pomona.recording import open_recording
from pomona.survey import Boxes
from pomona.survey.box_edges import check_size_of_boxes

ROW = Path(__file__).parents[1] / "examples" / "row"


def true_boxes(visit: Path, times: float = 1.0) -> Boxes:
    """Boxes of a shipped recording, so many times as large about their middles."""
    with (visit / "boxes.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    sides_px = np.array([[float(line[name]) for name in ("xmin", "ymin", "xmax", "ymax")] for line in lines])
    middles, halves = (sides_px[:, :2] + sides_px[:, 2:]) / 2, times * (sides_px[:, 2:] - sides_px[:, :2]) / 2
    frames = np.array([int(line["frame"]) for line in lines])
    return Boxes(frames, np.hstack([middles - halves, middles + halves]), np.ones(len(frames)), np.arange(len(frames)))


def told(visit: Path, boxes: Boxes) -> list[str]:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", PomonaWarning)
        check_size_of_boxes(open_recording(visit / "row.mp4"), [boxes])
    return [str(one.message) for one in said]


@pytest.mark.parametrize("date", ["2024-08-09", "2024-08-28", "2024-09-12"])
def test_boxes_of_another_size_than_the_fruits_are_told_with_how_much(date: str) -> None:
    visit = ROW / date
    assert told(visit, true_boxes(visit)) == []
    for times in (1.15, 0.85):
        (message,) = told(visit, true_boxes(visit, times))
        assert message.startswith(f"{visit / 'row.mp4'}: boxes are ")
        assert float(message.split("boxes are ")[1].split()[0]) == pytest.approx(times, abs=0.05)


def test_boxes_that_are_few_small_or_of_nothing_say_nothing_of_their_size() -> None:
    visit = ROW / "2024-09-12"
    boxes = true_boxes(visit, 1.15)

    def some(rows: NDArray[np.int64]) -> Boxes:
        return Boxes(boxes.frames[rows], boxes.boxes_px[rows], boxes.scores[rows], boxes.fruits[rows])

    assert told(visit, some(np.arange(0, len(boxes.frames), 40))) == []
    assert told(visit, some(np.arange(0))) == []
    sides = np.array([640, 360, 640, 360])
    rng = np.random.default_rng(3)
    corners = rng.uniform(0.2, 0.8, (len(boxes.frames), 2))
    nowhere = np.hstack([corners, corners]) * sides + [-12, -12, 12, 12]
    assert told(visit, Boxes(boxes.frames, nowhere, boxes.scores, boxes.fruits)) == []
    small = true_boxes(visit, 0.2)
    assert told(visit, small) == []
