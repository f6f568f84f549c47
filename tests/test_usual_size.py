"""Photographs in which fruits are larger than those that the detector has learnt from."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from pomona.detect.accuracy import Found, judged
from pomona.detect.onnx import OnnxDetector
from pomona.detect.onnx.usual_size import TOO_LARGE, USUAL_PX, shrunk_by
from pomona.detect.picture_file import read_picture
from pomona.detect.shipped import SHIPPED, model_named

PICTURES = Path(__file__).parents[1] / "testdata" / "pictures"


def boxes(side_px: float, score: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    return np.tile([0.0, 0.0, side_px, side_px], (count, 1)), np.full(count, score)


def together(*looks: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    boxes_px, scores = zip(*looks, strict=True)
    return np.concatenate(boxes_px), np.concatenate(scores)


def test_what_is_not_much_larger_is_left_as_it_is() -> None:
    assert shrunk_by(boxes(TOO_LARGE * USUAL_PX - 1, 0.9, 3), 1.0, None) == 1.0
    assert shrunk_by(boxes(10.0, 0.9, 3), 1.0, None) == 1.0
    assert shrunk_by(boxes(0.0, 0.9, 0), 1.0, None) == 1.0


def test_large_fruits_get_their_usual_size_and_what_is_unsure_does_not_tell() -> None:
    assert shrunk_by(boxes(160.0, 0.9, 3), 1.0, None) == pytest.approx(USUAL_PX / 160)
    assert shrunk_by(boxes(160.0, 0.9, 3), 0.5, None) == pytest.approx(USUAL_PX / 80)
    assert shrunk_by(boxes(160.0, 0.9, 3), 1.0, 120.0) == 1.0
    assert shrunk_by(together(boxes(160.0, 0.9, 3), boxes(10.0, 0.2, 9)), 1.0, None) == pytest.approx(USUAL_PX / 160)


def test_many_edges_that_are_taken_for_small_fruits_do_not_hide_the_large_ones() -> None:
    assert shrunk_by(together(boxes(80.0, 0.9, 4), boxes(20.0, 0.9, 40)), 1.0, None) == pytest.approx(USUAL_PX / 80)


@pytest.mark.parametrize(("which", "times"), [("apple_81", 2), ("apple_81", 4), ("apple_76", 4)])
def test_an_enlarged_photograph_has_as_many_fruits(which: str, times: int) -> None:
    """Seen as they are, of pictures four times as large half of the fruits are lost, and half of the boxes are none."""
    (path,) = PICTURES.glob(f"{which}_*.jpg")
    lines = (PICTURES / "boxes.csv").read_text(encoding="utf-8").splitlines()
    fruits_px = times * np.array([line.split(",")[1:5] for line in lines if line.startswith(path.name)], float)
    picture = cv2.resize(read_picture(path), None, fx=times, fy=times, interpolation=cv2.INTER_CUBIC)
    found = OnnxDetector.open(model_named(SHIPPED), augment=True, threads=1).detect(picture)
    precision, recall = judged([Found(found, fruits_px, np.empty((0, 4)))]).above(0.343)
    assert precision > 0.75
    assert recall > 0.75
