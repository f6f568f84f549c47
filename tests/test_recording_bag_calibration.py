"""The cameras of a bag: what is calibrated, rectified or refused."""

import cv2
import numpy as np
import pytest

from bag_maker import (
    SIZE,
    START_NS,
    image,
    info,
    picture,
    refused,
    stereo,
    write_bag,
)
from pomona.recording import open_recording


def test_left_and_right_of_different_size(tmp_path):
    entries = [entry for entry in stereo(2) if entry[0] != "/stereo/right/image_rect_color"]
    entries.append(image("/stereo/right/image_rect_color", START_NS, picture(1, (32, 24)), "bgr8"))
    refused(write_bag(tmp_path / "row", entries, "mcap"), "found 64x48 and 32x24 pixels, expected equal sizes")


def test_a_missing_camera_info(tmp_path):
    entries = [entry for entry in stereo(2) if entry[0] != "/stereo/right/camera_info"]
    bag = write_bag(tmp_path / "row", entries, "mcap")
    refused(bag, "/stereo/right/image_rect_color: found no camera_info for it, expected /stereo/right/camera_info")


def test_a_camera_info_that_changes(tmp_path):
    entries = stereo(3)
    entries.append(info("/stereo/left/camera_info", START_NS + 1, f=61.0))
    bag = write_bag(tmp_path / "row", entries, "ros1")
    refused(bag, "/stereo/left/camera_info: found 2 camera_info that differ, expected one camera on a topic")


@pytest.mark.parametrize(
    ("shift", "parts"),
    [
        (0.0, ["no baseline"]),
        (-60 * 120.0, ["found a baseline of 120", "looks like millimetres"]),
        (60 * 0.12, ["found the right camera on the left: swap left and right"]),
    ],
)
def test_baselines_that_are_none(tmp_path, shift, parts):
    entries = [entry for entry in stereo(2) if entry[0] != "/stereo/right/camera_info"]
    entries.append(info("/stereo/right/camera_info", START_NS, shift))
    refused(write_bag(tmp_path / "row", entries, "mcap"), *parts)


def test_a_camera_that_is_not_calibrated(tmp_path):
    entries = [entry for entry in stereo(2) if entry[0] != "/stereo/left/camera_info"]
    entries.append(info("/stereo/left/camera_info", START_NS, K=np.zeros(9), P=np.zeros(12)))
    refused(write_bag(tmp_path / "row", entries, "mcap"), "/stereo/left/camera_info", "its K is 0")


def test_the_calibration_beside_a_bag_or_given(tmp_path):
    from test_recording_video import write_calibration

    entries = [entry for entry in stereo(2) if "info" not in entry[0]]
    bag = write_bag(tmp_path / "row", entries, "mcap")
    write_calibration(tmp_path, baseline_m=0.2)
    assert open_recording(bag).calibration.baseline_m == 0.2
    (tmp_path / "other").mkdir()
    write_calibration(tmp_path / "other", baseline_m=0.3)
    whole = write_bag(tmp_path / "whole", stereo(2), "mcap")
    assert open_recording(whole, calibration=tmp_path / "other").calibration.baseline_m == 0.3
    assert tmp_path / "other" / "calibration.json" in list(
        open_recording(whole, calibration=tmp_path / "other").inputs()
    )


def test_raw_pairs_are_rectified(tmp_path):
    """`image_raw` with R and P: the rectified picture is the raw one turned by R, and P is its camera."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec([0, 0, 0.1]).as_matrix()
    entries = []
    for side, shift in (("left", 0.0), ("right", -60 * 0.12)):
        entries.append(info(f"/stereo/{side}/camera_info", START_NS, shift, R=turn.ravel()))
        smooth = cv2.GaussianBlur(picture(1), (0, 0), 4)
        entries.append(image(f"/stereo/{side}/image_raw", START_NS, smooth, "bgr8"))
    recording = open_recording(write_bag(tmp_path / "row", entries, "ros1"))
    left = next(recording.frames()).read_left()
    matrix = np.array([[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]])
    expected = cv2.warpPerspective(smooth, matrix @ turn @ np.linalg.inv(matrix), SIZE)
    assert cv2.absdiff(left, expected)[8:-8, 8:-8].max() <= 2
