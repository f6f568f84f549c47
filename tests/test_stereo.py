"""Stereo depth at the fruits, on rendered pairs with exact depth and on a plane whose disparity is known."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from depth_scene import CAMERA
from pomona.depth import lift
from pomona.errors import PomonaError
from pomona.recording import Calibration, open_recording
from pomona.stereo import StereoDepth

PAIR = Calibration(width=640, height=360, fx=420.0, fy=420.0, cx=320.0, cy=180.0, baseline_m=0.12)


def plane(depth_m):
    """Two views of a textured plane across the optical axis."""
    rng = np.random.default_rng(0)
    texture = cv2.GaussianBlur(rng.normal(size=(PAIR.height, PAIR.width + 200)), (0, 0), 1.5)
    texture = np.clip(128 + 120 * texture / texture.std() / 3, 0, 255).astype(np.float32)
    disparity = PAIR.fx * PAIR.baseline_m / depth_m
    x, y = np.meshgrid(np.arange(PAIR.width, dtype=np.float32), np.arange(PAIR.height, dtype=np.float32))
    views = [
        cv2.remap(texture, x + np.float32(100 + shift), y, cv2.INTER_CUBIC).astype(np.uint8) for shift in (0, disparity)
    ]
    return views[0], views[1]


def test_depth_is_measured_at_the_boxes_and_nowhere_else():
    left, right = plane(1.5)
    boxes = np.array([[300.0, 100.0, 330.0, 130.0], [8.0, 200.0, 40.0, 230.0]])
    found = StereoDepth(PAIR)(left, right, boxes)
    assert found.depth_m.shape == left.shape
    assert found.disparity_sigma_px.shape == (2,)
    inside = found.depth_m[105:125, 305:325]
    assert np.mean(inside > 0) > 0.9
    assert np.median(inside[inside > 0]) == pytest.approx(1.5, rel=0.01)
    assert not found.depth_m[:80].any()
    assert not found.depth_m[:, 400:].any()


def test_no_boxes_give_an_empty_picture():
    found = StereoDepth(PAIR)(*plane(1.0), np.empty((0, 4)))
    assert not found.depth_m.any()


def test_a_camera_without_a_baseline_is_refused():
    with pytest.raises(PomonaError, match="baseline_m"):
        StereoDepth(CAMERA)


def test_disparity_noise_lengthens_the_covariance_along_the_ray(shared_data):
    recording = open_recording(shared_data / "rendered_row" / "2024-08-09")
    frame = next(iter(recording.frames()))
    ids = cv2.imread(str(shared_data / "rendered_row" / "2024-08-09" / "ids" / "0000.png"), cv2.IMREAD_UNCHANGED)
    largest = np.argmax(np.bincount(ids[ids > 0]))
    y, x = np.nonzero(ids == largest)
    box = np.array([[x.min(), y.min(), x.max() + 1, y.max() + 1]], float)
    exact, rough = (
        lift(frame.read_depth(), box, recording.calibration, disparity_sigma_px=sigma) for sigma in (None, 0.5)
    )
    z = exact.centres_in_camera[0, 2]
    grown = rough.covariances[0, 2, 2] - exact.covariances[0, 2, 2]
    assert np.sqrt(grown) == pytest.approx(recording.calibration.depth_error_m(z, 0.5), rel=1e-6)
    with pytest.raises(PomonaError, match="baseline_m"):
        lift(frame.read_depth(), box, replace(recording.calibration, baseline_m=None), disparity_sigma_px=0.5)
