"""What networks are given, to the grey level."""

import numpy as np
import pytest
from PIL import Image

from pomona.detect.onnx.candidates import Candidates, suppress
from pomona.detect.onnx.families import FAMILIES
from pomona.detect.onnx.preparation import Preparation, prepare

BLUE, GREEN, RED = 10, 20, 200
PICTURE = np.full((60, 120, 3), (BLUE, GREEN, RED), np.uint8)


def test_letterbox_centres_between_grey_bars():
    given, placement = prepare(PICTURE, (64, 64), FAMILIES["yolov8"].preparation)
    assert given.shape == (3, 64, 64)
    assert given.dtype == np.float32
    assert np.allclose(given[:, 16:48], np.float32([RED, GREEN, BLUE])[:, None, None] / 255)
    assert np.allclose(given[:, [15, 48]], 114 / 255)
    assert np.allclose(placement.to_picture(np.array([[0, 16, 64, 48.0]])), [[0, 0, 120, 60]])


def test_yolox_fills_the_corner_with_bytes():
    given, placement = prepare(PICTURE, (64, 64), FAMILIES["yolox"].preparation)
    assert np.allclose(given[:, :32], np.float32([BLUE, GREEN, RED])[:, None, None])
    assert np.allclose(given[:, 32], 114)
    assert np.allclose(placement.to_picture(np.array([[0, 0, 64, 32.0]])), [[0, 0, 120, 60]])


def test_transformers_stretch():
    given, placement = prepare(PICTURE, (32, 48), FAMILIES["rtdetr"].preparation)
    assert np.allclose(given, np.float32([RED, GREEN, BLUE])[:, None, None] / 255)
    assert np.allclose(placement.to_picture(np.array([[0, 0, 32, 48.0]])), [[0, 0, 120, 60]])
    given, _ = prepare(PICTURE, (32, 48), FAMILIES["rfdetr"].preparation)
    expected = [(RED / 255 - 0.485) / 0.229, (GREEN / 255 - 0.456) / 0.224, (BLUE / 255 - 0.406) / 0.225]
    assert np.allclose(given[:, 0, 0], expected)


@pytest.mark.parametrize("size_px", [(64, 40), (100, 100), (200, 90), (500, 300)])
def test_smooth_is_what_pillow_does(size_px):
    picture = np.random.default_rng(3).integers(0, 256, (123, 211, 3)).astype(np.uint8)
    given, _ = prepare(picture, size_px, Preparation(fit="stretch", channels="BGR", resize="smooth", divide_by=1.0))
    pillow = np.asarray(Image.fromarray(picture).resize(size_px, Image.Resampling.BILINEAR), np.float32)
    assert np.abs(given.transpose(1, 2, 0) - pillow).max() <= 1.0  # Pillow rounds to bytes, twice


def candidates(*rows):
    boxes_px, scores, classes = zip(*rows, strict=True)
    n = len(rows)
    return Candidates(np.array(boxes_px, float), np.array(scores), np.array(classes), np.arange(n))


def test_suppression_keeps_the_best_of_what_overlaps():
    given = candidates(
        ([0, 0, 10, 10], 0.5, 0),
        ([0, 0, 10, 9], 0.9, 0),  # overlaps by 0.9
        ([0, 2, 10, 12], 0.8, 1),  # by 7/12 with the second, 8/12 with the first
        ([20, 0, 30, 10], 0.3, 0),
    )
    assert suppress(given, 0.6, across_classes=True).sources.tolist() == [1, 2, 3]
    assert suppress(given, 0.5, across_classes=True).sources.tolist() == [1, 3]
    assert suppress(given, 0.5, across_classes=False).sources.tolist() == [1, 2, 3]
    assert suppress(given, 0.95, across_classes=True).sources.tolist() == [1, 2, 0, 3]


def test_suppression_of_equals_keeps_the_first():
    given = candidates(*[([0, 0, 10, 10], 0.5, 0)] * 3)
    assert suppress(given, 0.5, across_classes=True).sources.tolist() == [0]
