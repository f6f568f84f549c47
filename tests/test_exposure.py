"""Pictures that were exposed differently: from frame to frame, and left from right."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.disturbed_boxes import rolling
from tests.drive_scene import CALIBRATION, drive, sideways

from depth_scene import box_of
from pomona.odometry import StereoOdometry
from pomona.stereo import StereoDepth
from pomona.stereo.exposure import gain, like
from stereo_scene import PAIR, apple, pair


def exposed(picture: np.ndarray, factor: float) -> np.ndarray:
    return np.clip(np.rint(picture * factor), 0, 255).astype(np.uint8)


def test_the_gain_is_found_and_taken_out() -> None:
    left, right, _ = drive(sideways(1)).pictures(0)
    assert gain(exposed(right, 0.7), left) == pytest.approx(1 / 0.7, rel=0.02)
    assert np.abs(like(exposed(right, 0.7), left).astype(int) - right).mean() < 2.0


def test_pictures_that_were_exposed_alike_stay_as_they_are() -> None:
    left, right, _ = drive(sideways(1)).pictures(0)
    assert like(right, left) is right


@pytest.mark.parametrize("stops", [0.5, 1.0])
def test_a_camera_that_changes_its_exposure_is_followed(stops: float) -> None:
    scene = drive(sideways(12))
    odometry = StereoOdometry(CALIBRATION)
    factors = 2.0 ** (stops * np.random.default_rng(3).choice([-1.0, 1.0], 12))
    for row, factor in enumerate(factors):
        left, right, _ = scene.pictures(row)
        motion = odometry(exposed(left, factor), exposed(right, factor))
        assert motion.part == 0, motion.broken
        assert motion.session_from_camera is not None, motion.lost
        assert np.linalg.norm(motion.session_from_camera[:3, 3] - scene.poses[row][:3, 3]) < 0.02


def test_a_camera_under_lamps_that_flicker_is_followed() -> None:
    scene, flicker = drive(sideways(8)), rolling(0.4)
    odometry = StereoOdometry(CALIBRATION)
    for row in range(8):
        pictures = (flicker(one[..., None], "", row)[..., 0] for one in scene.pictures(row)[:2])
        motion = odometry(*pictures)
        assert motion.part == 0, motion.broken
        assert motion.inliers > 60 or row == 0
        assert motion.session_from_camera is not None, motion.lost
        assert np.linalg.norm(motion.session_from_camera[:3, 3] - scene.poses[row][:3, 3]) < 0.01


@pytest.mark.parametrize("factor", [0.7, 0.4])
def test_a_camera_with_one_dark_eye_is_followed(factor: float) -> None:
    scene = drive(sideways(6))
    odometry = StereoOdometry(CALIBRATION)
    for row in range(6):
        left, right, _ = scene.pictures(row)
        motion = odometry(left, exposed(right, factor))
        assert motion.session_from_camera is not None, motion.lost
        assert np.linalg.norm(motion.session_from_camera[:3, 3] - scene.poses[row][:3, 3]) < 0.02


@pytest.mark.parametrize("factor", [0.7, 0.4])
def test_fruits_match_in_a_dark_eye(factor: float) -> None:
    fruits = [apple(-0.35, 0.0, 1.5), apple(0.0, -0.1, 1.4), apple(0.3, 0.1, 1.6)]
    left, right, _ = pair(fruits)
    boxes_px = np.array([box_of(fruit, PAIR) for fruit in fruits])
    expected = StereoDepth(PAIR)(left, right, boxes_px).disparity_px
    found = StereoDepth(PAIR)(left, exposed(right, factor), boxes_px).disparity_px
    np.testing.assert_allclose(found, expected, atol=0.3)
