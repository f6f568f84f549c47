import json
import re

import cv2
import numpy as np
import pytest

import refusal
from pomona import PomonaError
from pomona.recording import Calibration, open_recording
from pomona.recording.pictures import UnreadablePictureError
from recording_maker import FIELDS, make_recording


@pytest.fixture
def folder(tmp_path):
    return make_recording(tmp_path / "row", (0.0, 0.1))


def read_all(folder):
    for frame in open_recording(folder).frames():
        frame.read_depth()


def refused(folder, *parts):
    refusal.refused(lambda: read_all(folder), *parts)


def with_fields(folder, **changes):
    fields = {name: value for name, value in {**FIELDS, **changes}.items() if value is not ...}
    (folder / "calibration.json").write_text(json.dumps(fields))


def test_a_folder_gives_its_frames_in_order(folder):
    recording = open_recording(folder)
    assert recording.numbers == (0, 1)
    first, second = recording.frames()
    assert (second.number, second.time_s) == (1, 0.1)
    assert second.session_from_camera[:3, 3].tolist() == [0.1, 0, 0]
    assert first.read_left is None
    depth_m = first.read_depth()
    assert depth_m.shape == (480, 640)
    assert depth_m.dtype == np.float32
    assert depth_m.max() == pytest.approx(3.0)


def test_pictures_are_decoded_when_asked_for(folder):
    (folder / "depth" / "0001.png").write_bytes(b"not a picture")
    first, second = open_recording(folder).frames()
    first.read_depth()
    with pytest.raises(PomonaError, match=r"0001\.png"):
        second.read_depth()


def test_the_depth_unit_is_that_of_the_calibration(folder):
    with_fields(folder, depth_unit_m=0.0005)
    assert next(open_recording(folder).frames()).read_depth().max() == pytest.approx(1.5)


def test_colour_is_read_where_it_is(folder):
    (folder / "left").mkdir()
    for number in (0, 1):
        cv2.imwrite(str(folder / "left" / f"{number:04d}.jpg"), np.full((480, 640, 3), 90, np.uint8))
    frame = next(open_recording(folder).frames())
    assert frame.read_left().shape == (480, 640, 3)


@pytest.mark.parametrize(
    ("name", "date"),
    [
        ("2024-08-09", "2024-08-09"),
        ("row 3 2024-08-09_141530", "2024-08-09T14:15:30"),
        ("2024-08-09T14:15", "2024-08-09T14:15:00"),
        ("row3", None),
        ("2024-99-09", None),
    ],
)
def test_the_date_is_in_the_name(tmp_path, name, date):
    assert open_recording(make_recording(tmp_path / name)).date == date


def test_recording_json_says_name_and_date(folder):
    (folder / "recording.json").write_text('{"name": "row 3, east", "date": "2021-09-27T11:40:12"}')
    recording = open_recording(folder)
    assert (recording.name, recording.date) == ("row 3, east", "2021-09-27T11:40:12")


def test_a_calibration_reads_back(tmp_path):
    calibration = Calibration(width=640, height=480, fx=500.5, fy=501.0, cx=319.0, cy=241.0, baseline_m=0.12)
    calibration.write(tmp_path / "calibration.json")
    assert Calibration.read(tmp_path / "calibration.json") == calibration


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"width": 0}, "width: found 0, expected a whole number of pixels"),
        ({"height": 480.5}, "height: found 480.5, expected a whole number of pixels"),
        ({"fx": -1.0}, "fx: found -1.0, expected pixels above 0"),
        ({"fy": float("nan")}, "fy: found nan, expected pixels above 0"),
        ({"cx": float("inf")}, "cx: found inf, expected pixels"),
        ({"cy": "240"}, "cy: found '240', expected pixels"),
        ({"baseline_m": -0.1}, "baseline_m: found -0.1, expected metres above 0, or None"),
        ({"depth_unit_m": 0}, "depth_unit_m: found 0, expected metres above 0"),
    ],
)
def test_a_calibration_of_no_camera_is_refused(changes, told):
    right = {"width": 640, "height": 480, "fx": np.float32(500.0), "fy": 501, "cx": 319.0, "cy": 241.0}
    assert Calibration(**right).size_px == (640, 480)
    with pytest.raises(PomonaError) as refusal:
        Calibration(**{**right, **changes})
    assert str(refusal.value) == told


@pytest.mark.parametrize("field", ["width", "height", "fx", "fy", "cx", "cy"])
def test_a_missing_field_is_named(folder, field):
    with_fields(folder, **{field: ...})
    refused(folder, "calibration.json", f"{field}: missing")


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"fx": 3.6}, ["fx: found 3.6", "expected 128 to 12800", "pixels"]),  # millimetres of focal length
        ({"fx": 0.94}, ["fx: found 0.94"]),  # over the width
        ({"fy": -600}, ["fy: found -600"]),
        ({"fx": "600"}, ["fx: found '600'", "expected a number"]),
        ({"fx": True}, ["fx: found True"]),
        ({"cx": 0.5 - 1}, ["cx: found -0.5"]),
        ({"cx": 700}, ["cx: found 700", "0 to 640"]),
        ({"width": 640.5}, ["width: found 640.5", "whole number"]),
        ({"baseline_m": 120}, ["baseline_m: found 120", "metres"]),
        ({"depth_unit_m": 1}, ["depth_unit_m: found 1"]),
        ({"rectified": False}, ["rectified: found False"]),
    ],
)
def test_a_wrong_field_is_named(folder, changes, parts):
    with_fields(folder, **changes)
    refused(folder, "calibration.json", *parts)


def test_nan_in_a_calibration_is_refused(folder):
    (folder / "calibration.json").write_text(json.dumps({**FIELDS, "fx": float("nan")}))
    refused(folder, "fx: found nan")


def test_a_stereo_recording_needs_a_baseline(folder):
    (folder / "right").mkdir()
    for number in (0, 1):
        cv2.imwrite(str(folder / "right" / f"{number:04d}.png"), np.zeros((480, 640, 3), np.uint8))
    refused(folder, "baseline_m: missing")
    with_fields(folder, baseline_m=0.12)
    assert open_recording(folder).calibration.baseline_m == 0.12


def test_a_calibration_that_is_no_json_is_refused(folder):
    (folder / "calibration.json").write_text("fx: 600")
    refused(folder, "calibration.json", "not JSON")
    (folder / "calibration.json").write_text("[600]")
    refused(folder, "calibration.json", "found a JSON list")
    (folder / "calibration.json").unlink()
    refused(folder, "calibration: found none", "calibration.json")


@pytest.mark.parametrize(
    ("picture", "parts"),
    [
        (np.zeros((480, 641), np.uint16), ["found 641x480", "expected 640x480"]),
        (np.zeros((480, 640), np.uint8), ["found 8-bit", "expected 16 bit"]),
        (np.zeros((480, 640, 3), np.uint16), ["found 3 channels", "expected one"]),
    ],
)
def test_a_depth_picture_of_the_wrong_kind_is_refused(folder, picture, parts):
    cv2.imwrite(str(folder / "depth" / "0001.png"), picture)
    refused(folder, "0001.png", *parts)


@pytest.mark.parametrize("size", [0, 5, 200, -20])
def test_a_cut_png_is_refused(folder, size):
    file = folder / "depth" / "0000.png"
    file.write_bytes(file.read_bytes()[:size])
    refused(folder, "0000.png")


def test_bytes_flipped_inside_a_png_are_refused(folder, capfd):
    file = folder / "depth" / "0000.png"
    content = bytearray(file.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 40] = bytes(byte ^ 0xFF for byte in content[middle : middle + 40])
    file.write_bytes(content)
    refused(folder, "0000.png")


def test_frames_without_a_number_or_twice_are_refused(folder):
    (folder / "depth" / "0001.PNG").write_bytes((folder / "depth" / "0001.png").read_bytes())
    refused(folder, "frame 1 is there twice")
    (folder / "depth" / "0001.PNG").rename(folder / "depth" / "last.png")
    refused(folder, "last.png", "expected a frame number")


def test_a_frame_that_is_missing_in_one_folder_is_named(folder):
    (folder / "left").mkdir()
    cv2.imwrite(str(folder / "left" / "0000.png"), np.zeros((480, 640, 3), np.uint8))
    whole, lacking = open_recording(folder).frames()
    assert whole.read_left().shape == (*lacking.read_depth().shape, 3)
    with pytest.raises(UnreadablePictureError, match=r"left/0001\.png: not there"):
        lacking.read_left()


def test_what_is_no_recording_is_refused(tmp_path):
    refused(tmp_path / "nowhere", "not found")
    (tmp_path / "video.bin").write_bytes(b"")
    refused(tmp_path / "video.bin", "found a file")
    with_fields(tmp_path)
    refused(tmp_path, "no pictures")


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("0 0 0 0 0 0 0 1\n", ["found 1 poses", "2 frames"]),
        ("0 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 1\n", ["line 2", "found 7 numbers"]),
        ("0 0 0 0 0 0 0 1\n0.1 0 0 x 0 0 0 1\n", ["line 2", "'x'"]),
        ("0 0 0 0 0 0 0 1\n0.1 0 0 nan 0 0 0 1\n", ["line 2", "'nan'"]),
        ("0 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 0 0\n", ["line 2", "quaternion of length 0"]),
        ("0.1 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 0 1\n", ["pose 2", "does not come after"]),
    ],
)
def test_wrong_poses_are_refused(folder, text, parts):
    (folder / "poses_tum.txt").write_text(text)
    refused(folder, "poses_tum.txt", *parts)


def test_poses_turn_as_quaternions_say(folder):
    half = np.sqrt(0.5)
    (folder / "poses_tum.txt").write_text(f"0 1 2 3 0 0 {half} {half}\n1 0 0 0 0 0 0 1\n")
    pose = open_recording(folder).trajectory.session_from_camera[0]
    np.testing.assert_allclose(pose[:3, :3] @ [1, 0, 0], [0, 1, 0], atol=1e-9)
    np.testing.assert_allclose(pose[:3, 3], [1, 2, 3])


def test_poses_of_the_rendered_row_agree_with_scipy(shared_data):
    from scipy.spatial.transform import Rotation

    folder = shared_data / "rendered_row" / "2024-08-09"
    trajectory = open_recording(folder).trajectory
    quaternions = np.loadtxt(folder / "poses_tum.txt")[:, 4:]
    np.testing.assert_allclose(
        trajectory.session_from_camera[:, :3, :3], Rotation.from_quat(quaternions).as_matrix(), atol=1e-9
    )


def test_the_pixel_convention_is_that_of_the_rendered_row(shared_data):
    """Discs are centred where the truth projects to when pixel centres are at one half, not at whole numbers."""
    from benchmarks.recordings import in_camera, rendered_truth, visible_pixels

    folder = shared_data / "rendered_row" / "2024-08-09"
    recording, truth = open_recording(folder), rendered_truth(folder)
    offsets = []
    for frame in list(recording.frames())[::4]:
        for name, x, y in visible_pixels(folder, frame.number):
            row = truth.ids.index(name)
            centre = in_camera(frame.session_from_camera, truth.positions[row])
            radius_px = recording.calibration.fx * truth.diameters_m[row] / 2 / centre[2]
            if len(x) > 0.95 * np.pi * radius_px**2:
                projected = recording.calibration.fx * centre[:2] / centre[2]
                principal = (recording.calibration.cx, recording.calibration.cy)
                offsets.append((x.mean() + 0.5, y.mean() + 0.5) - projected - principal)
    assert len(offsets) > 10
    assert np.abs(np.median(offsets, axis=0)).max() < 0.25


def test_read_errors_name_one_file(folder):
    (folder / "depth" / "0000.png").unlink()
    (folder / "depth" / "0000.png").mkdir()
    with pytest.raises(PomonaError, match=re.escape("0000.png")):
        next(open_recording(folder).frames()).read_depth()


def test_a_calibration_of_another_size_is_told_before_anything_is_read(folder):
    with_fields(folder, width=1280, height=960, cx=640.0, cy=480.0, fx=1200.0, fy=1200.0)
    refused(folder, "calibration.json: width, height: found 1280x960, expected 640x480 as 0000.png is")
