"""Pictures of depth that are not of their colour pictures."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from pomona.errors import PomonaWarning
from pomona.recording import open_recording
from pomona.survey.depth_check import check_depth_pictures
from pomona.survey.part import Boxes

N_FRAMES, SIZE_PX, RADIUS_PX, A_FRAME_PX = 6, (320, 180), 9, 17
NUMBERS = {"width": 320, "height": 180, "fx": 250.0, "fy": 250.0, "cx": 160.0, "cy": 90.0, "depth_unit_m": 0.001}


def places(frame: int) -> np.ndarray:
    """Middles of the fruits, (D, 2), which go to the left."""
    rng = np.random.default_rng(3)
    middles = rng.uniform([0.0, 30.0], [420.0, 150.0], (40, 2)) - [A_FRAME_PX * frame, 0]
    return middles[(middles[:, 0] > 30) & (middles[:, 0] < SIZE_PX[0] - 30)]


def depth_of(frame: int, moved_px: tuple[int, int], size: float) -> np.ndarray:
    """Fruits before leaves, each at its own depth, with noise and holes, in millimetres."""
    rng = np.random.default_rng(10 + frame)
    leaves = cv2.resize(rng.uniform(1300, 2200, (23, 40)).astype(np.float32), SIZE_PX, interpolation=cv2.INTER_NEAREST)
    for row, middle in enumerate(places(frame)):
        x, y = (NUMBERS["cx"], NUMBERS["cy"]) + size * (middle - (NUMBERS["cx"], NUMBERS["cy"])) + moved_px
        cv2.circle(leaves, (round(x), round(y)), round(size * RADIUS_PX), 1150.0 + 5 * row, -1)
    noisy = leaves + rng.normal(0, 6, leaves.shape)
    return np.where(rng.random(leaves.shape) < 0.2, 0, noisy).astype(np.uint16)


def told(folder: Path, **wrong: Any) -> str:
    """What is warned of."""
    boxes = made(folder, **wrong)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", PomonaWarning)
        check_depth_pictures(open_recording(folder), [boxes])
    return " ".join(str(one.message) for one in caught)


def made(folder: Path, moved_px: tuple[int, int] = (0, 0), size: float = 1.0, late: int = 0) -> Boxes:
    """Write a recording, and give its boxes."""
    for side in ("left", "depth"):
        (folder / side).mkdir(parents=True)
    for frame in range(N_FRAMES):
        cv2.imwrite(str(folder / "left" / f"{frame:04d}.png"), np.full((*SIZE_PX[::-1], 3), 90, np.uint8))
        cv2.imwrite(str(folder / "depth" / f"{frame:04d}.png"), depth_of(frame - late, moved_px, size))
    (folder / "calibration.json").write_text(json.dumps(NUMBERS))
    frames = np.repeat(np.arange(N_FRAMES), [len(places(frame)) for frame in range(N_FRAMES)])
    middles = np.concatenate([places(frame) for frame in range(N_FRAMES)])
    boxes_px = np.hstack([middles - RADIUS_PX, middles + RADIUS_PX])
    return Boxes(frames, boxes_px, np.ones(len(frames)), np.full(len(frames), -1))


def test_depth_of_the_same_view_is_left_alone(tmp_path: Path) -> None:
    assert told(tmp_path / "row") == ""


@pytest.mark.parametrize(
    ("wrong", "where"),
    [
        ({"moved_px": (12, 0)}, "12 px to the right"),
        ({"moved_px": (-30, 6)}, "30 px to the left and 6 px lower"),
        ({"size": 0.8}, "0.8 times as large"),
        ({"size": 0.86, "moved_px": (8, 0)}, "0.85 times as large and 6 px to the right"),
        ({"late": 1}, "a frame later"),
        ({"late": -2}, "2 frames earlier"),
    ],
)
def test_depth_of_another_view_is_told(tmp_path: Path, wrong: dict[str, object], where: str) -> None:
    assert f"the fruits of the colour pictures are in the depth pictures {where}: register" in told(
        tmp_path / "row", **wrong
    )


@pytest.mark.parametrize(("size", "code"), [(1.0, 0), (0.86, 1)])
def test_info_tells_by_boxes_that_came_with_it(pomona, tmp_path: Path, size: float, code: int) -> None:
    boxes = made(tmp_path / "row", (8, 0) if code else (0, 0), size)
    table = np.column_stack([boxes.frames, boxes.boxes_px])
    header = "frame,xmin,ymin,xmax,ymax"
    np.savetxt(tmp_path / "row" / "detections.csv", table, delimiter=",", header=header, comments="")
    found, printed, _ = pomona("info", tmp_path / "row", "--check", "--json")
    told = json.loads(printed)["depth_fault"]
    assert found == code
    assert told is None if code == 0 else "0.85 times as large" in told
