"""Boxes that are of the pictures of other frames."""

from __future__ import annotations

import json
import warnings

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from pomona.errors import PomonaWarning
from pomona.recording import Recording, open_recording
from pomona.survey.box_times import check_box_times
from pomona.survey.part import Boxes

N_FRAMES = 9
SIZE_PX = (320, 180)
RADIUS_PX, A_FRAME_PX = 10, 25


def places(frame: int) -> NDArray[np.float64]:
    """Middles of the fruits, (D, 2), which go to the left."""
    x = np.arange(12) * 45.0 + 40 - A_FRAME_PX * frame
    y = np.tile([40.0, 90.0, 130.0], 4)
    return np.stack([x, y], axis=1)[(x > 2 * RADIUS_PX) & (x < SIZE_PX[0] - 2 * RADIUS_PX)]


@pytest.fixture(scope="module")
def row(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Red fruits among leaves."""
    folder = tmp_path_factory.mktemp("times") / "row"
    rng = np.random.default_rng(5)
    for side in ("left", "right"):
        (folder / side).mkdir(parents=True)
    for frame in range(N_FRAMES):
        leaves = cv2.GaussianBlur(rng.integers(0, 256, (*SIZE_PX[::-1], 3)).astype(np.uint8), (0, 0), 3.0)
        picture = (leaves * (0.3, 0.9, 0.4)).astype(np.uint8)
        for x, y in places(frame):
            cv2.circle(picture, (round(x), round(y)), RADIUS_PX, (40, 40, 190), -1)
        for side in ("left", "right"):
            assert cv2.imwrite(str(folder / side / f"{frame:04d}.png"), picture)
    numbers = {"width": 320, "height": 180, "fx": 250.0, "fy": 250.0, "cx": 160.0, "cy": 90.0, "baseline_m": 0.1}
    (folder / "calibration.json").write_text(json.dumps(numbers))
    return open_recording(folder)


def told(row: Recording, late: int, size: float = 1.0, down_px: float = 0.0) -> str:
    """What is said of boxes that are so many frames late, in pictures of another size, or lower."""
    found = [(frame, places(frame - late)) for frame in range(N_FRAMES) if frame - late >= 0]
    frames = np.repeat([frame for frame, _ in found], [len(middles) for _, middles in found])
    middles = np.concatenate([middles for _, middles in found])
    boxes_px = size * (np.hstack([middles - RADIUS_PX, middles + RADIUS_PX]) + np.tile([0.0, down_px], 2))
    boxes = Boxes(frames, boxes_px, np.ones(len(frames)), np.full(len(frames), -1))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", PomonaWarning)
        check_box_times(row, [boxes])
    return " ".join(str(one.message) for one in caught)


def test_boxes_of_their_own_pictures_are_left_alone(row: Recording) -> None:
    assert told(row, 0) == ""


@pytest.mark.parametrize(
    ("late", "where"), [(1, "a frame before"), (2, "2 frames before"), (-1, "a frame after"), (-5, "5 frames after")]
)
def test_boxes_of_other_pictures_are_told(row: Recording, late: int, where: str) -> None:
    assert f"the boxes fit the pictures {where} theirs, and not their own" in told(row, late)


@pytest.mark.parametrize(("size", "times"), [(0.5, "2"), (1 / 3, "3")])
def test_boxes_of_smaller_pictures_are_told(row: Recording, size: float, times: str) -> None:
    assert f"the boxes fit the pictures when they are {times} times as large, and not as they are" in told(row, 0, size)


def test_boxes_of_no_picture_say_nothing(row: Recording) -> None:
    assert told(row, 0, down_px=25.0) == ""
    check_box_times(row, [])
