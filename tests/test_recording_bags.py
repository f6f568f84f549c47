"""Bags written by rosbags and mcap: what goes in comes out, whatever the format."""

import subprocess
import sys
import threading
import warnings
from pathlib import Path

import cv2
import numpy as np
import pytest

from bag_maker import (
    FORMATS,
    SIZE,
    START_NS,
    STEP_NS,
    compressed,
    compressed_depth,
    image,
    info,
    picture,
    stereo,
    write_bag,
)
from pomona import PomonaError, PomonaWarning
from pomona.recording import open_recording, selected
from pomona.recording.bags import mcap_file
from pomona.recording.bags.picture_messages import ENCODINGS
from pomona.recording.checks.readable import unreadable_frames

OTHER_EYE = np.uint8(1)
"""What the right pictures differ by: a pair of one picture is refused."""


def refused(path, *parts, **options):
    with pytest.raises(PomonaError) as caught:
        open_recording(path, **options)
    assert "\n" not in str(caught.value)
    for part in parts:
        assert part in str(caught.value)


def rgbd(depths, *, colour=None, depth_topic="/camera/aligned_depth_to_color/image_raw", encoding="16UC1"):
    """Frames of /camera/color and of depth in its picture."""
    entries = []
    for row, depth in enumerate(depths):
        at = START_NS + row * STEP_NS
        entries += [
            info("/camera/color/camera_info", at),
            image("/camera/color/image_raw", at, picture(row) if colour is None else colour, "rgb8"),
            info(depth_topic.rpartition("/")[0] + "/camera_info", at),
            image(depth_topic, at + 1000, depth, encoding),
        ]
    return entries


@pytest.mark.parametrize("form", FORMATS)
def test_a_pair_comes_out_to_the_bit(tmp_path, form):
    recording = open_recording(write_bag(tmp_path / "2024-08-09_row", stereo(), form))
    assert recording.numbers == (0, 1, 2, 3)
    for frame in recording.frames():
        assert np.array_equal(frame.read_left(), picture(frame.number))
        assert np.array_equal(frame.read_right(), picture(1000 + frame.number))
        assert frame.read_depth is None
        assert frame.time_s == pytest.approx((START_NS + frame.number * STEP_NS) / 1e9, abs=1e-6)
    assert (recording.name, recording.date) == ("2024-08-09_row", "2024-08-09")
    assert recording.calibration.baseline_m == pytest.approx(0.12)
    assert recording.calibration.cx == SIZE[0] / 2
    assert unreadable_frames(recording) == {}


@pytest.mark.parametrize("form", FORMATS)
def test_info_prints_what_shows_a_wrong_unit(pomona, tmp_path, form):
    bag = write_bag(tmp_path / "row", stereo(), form)
    code, printed, errors = pomona("info", bag, "--check")
    assert code == 0, errors
    for line in (
        "frames         4",
        "rate_hz        10",
        "fx             60",
        "baseline_m     0.12",
        "depth_error_m  0.156 (at 1.5 m, disparity to 0.5 px)",
        "date           2024-08-09T08:00:00",
        "unreadable     0",
    ):
        assert line in printed


RGB = picture(3)
GREY = picture(4, channels=1)
BGR_OF = {
    "mono8": (GREY, cv2.cvtColor(GREY, cv2.COLOR_GRAY2BGR)),
    "8UC1": (GREY, cv2.cvtColor(GREY, cv2.COLOR_GRAY2BGR)),
    "bgr8": (RGB, RGB),
    "8UC3": (RGB, RGB),
    "rgb8": (RGB, RGB[:, :, ::-1]),
    "bgra8": (np.dstack([RGB, GREY]), RGB),
    "8UC4": (np.dstack([RGB, GREY]), RGB),
    "rgba8": (np.dstack([RGB, GREY]), RGB[:, :, ::-1]),
    "mono16": (GREY.astype(np.uint16) * 256 + 7, cv2.cvtColor(GREY, cv2.COLOR_GRAY2BGR)),
}


@pytest.mark.parametrize("encoding", BGR_OF)
@pytest.mark.parametrize("form", ["ros1", "mcap"])
def test_encodings(tmp_path, encoding, form):
    pixels, expected = BGR_OF[encoding]
    entries = [entry for entry in stereo(1) if "image" not in entry[0]]
    entries += [image(f"/stereo/{side}/image_rect", START_NS, pixels, encoding, pad=5) for side in ("left", "right")]
    frame = next(open_recording(write_bag(tmp_path / "row", entries, form)).frames())
    assert np.array_equal(frame.read_left(), expected)
    assert np.array_equal(frame.read_right(), expected)


@pytest.mark.parametrize(
    ("pattern", "corners"), [("rggb", "rggb"), ("bggr", "bggr"), ("gbrg", "gbrg"), ("grbg", "grbg")]
)
def test_bayer_patterns(tmp_path, pattern, corners):
    """A plain orange under a mosaic is a plain orange again."""
    value = {"r": 200, "g": 120, "b": 30}
    mosaic = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    for place, colour in enumerate(corners):
        mosaic[place // 2 :: 2, place % 2 :: 2] = value[colour]
    entries = [entry for entry in stereo(1) if "image" not in entry[0]]
    entries += [
        image(f"/stereo/{side}/image_rect", START_NS, mosaic, f"bayer_{pattern}8") for side in ("left", "right")
    ]
    left = next(open_recording(write_bag(tmp_path / "row", entries, "mcap")).frames()).read_left()
    assert np.array_equal(left[4:-4, 4:-4], np.broadcast_to([30, 120, 200], left[4:-4, 4:-4].shape))


@pytest.mark.parametrize("encoding", ["uyvy", "yuyv"])
def test_yuv(tmp_path, encoding):
    grey = np.repeat(picture(5, channels=1)[:, :, None], 2, axis=2)
    grey[:, :, 0 if encoding == "uyvy" else 1] = 128
    entries = [entry for entry in stereo(1) if "image" not in entry[0]]
    entries += [image(f"/stereo/{side}/image_rect", START_NS, grey, encoding) for side in ("left", "right")]
    left = next(open_recording(write_bag(tmp_path / "row", entries, "mcap")).frames()).read_left()
    luma = grey[:, :, 1 if encoding == "uyvy" else 0].astype(float)
    assert np.abs(left.mean(axis=2) - np.clip((luma - 16) * 255 / 219, 0, 255)).max() < 2


def test_every_encoding_of_the_table_is_tested():
    tested = {*BGR_OF, "16UC1", "32FC1", "uyvy", "yuyv", "yuv422", "yuv422_yuy2"}
    assert tested | {f"bayer_{pattern}8" for pattern in ("rggb", "bggr", "gbrg", "grbg")} == set(ENCODINGS)


@pytest.mark.parametrize("form", ["ros1 lz4", "sqlite3"])
def test_compressed_pictures(tmp_path, form):
    entries = [entry for entry in stereo(2) if "image" not in entry[0]]
    png = [cv2.imencode(".png", picture(row))[1].tobytes() for row in range(2)]
    jpeg = [cv2.imencode(".jpg", picture(row))[1].tobytes() for row in range(2)]
    for row in range(2):
        at = START_NS + row * STEP_NS
        entries.append(compressed("/stereo/left/image_rect/compressed", at, "bgr8; png compressed bgr8", png[row]))
        entries.append(compressed("/stereo/right/image_rect/compressed", at, "jpeg", jpeg[row]))
    for frame in open_recording(write_bag(tmp_path / "row", entries, form)).frames():
        assert np.array_equal(frame.read_left(), picture(frame.number))
        assert np.array_equal(frame.read_right(), cv2.imdecode(np.frombuffer(jpeg[frame.number], np.uint8), 1))


@pytest.mark.parametrize("form", FORMATS)
def test_colour_and_depth(tmp_path, form):
    depths = [picture(50 + row, channels=1, dtype=np.uint16) for row in range(2)]
    recording = open_recording(write_bag(tmp_path / "row", rgbd(depths), form))
    assert recording.description()["pictures"] == {"left": 2, "depth": 2}
    for frame, depth in zip(recording.frames(), depths, strict=True):
        assert np.array_equal(frame.read_left(), picture(frame.number)[:, :, ::-1])
        assert np.array_equal(frame.read_depth(), depth.astype(np.float32) * np.float32(0.001))


def test_depth_as_floats_is_in_metres(tmp_path):
    depth = picture(6, channels=1, dtype=np.uint16).astype(np.float32) / 1000
    depth[0, :4] = [np.nan, np.inf, -1, 0]
    recording = open_recording(write_bag(tmp_path / "row", rgbd([depth], encoding="32FC1"), "mcap"))
    read = next(recording.frames()).read_depth()
    assert read[0, :4].tolist() == [0, 0, 0, 0]
    assert np.array_equal(read[1:], depth[1:])


def test_compressed_depth(tmp_path):
    whole = picture(7, channels=1, dtype=np.uint16)
    topic = "/camera/aligned_depth_to_color/image_raw/compressedDepth"
    entries = [entry for entry in rgbd([whole]) if "depth" not in entry[0]]
    bag = write_bag(tmp_path / "whole", [*entries, compressed_depth(topic, START_NS, whole)], "ros1")
    assert np.array_equal(next(open_recording(bag).frames()).read_depth(), whole.astype(np.float32) * np.float32(0.001))
    # compressed_depth_image_transport with depth_quantization 100 and depth_max 10: A = 100 * 101, B = 1 - A / 10
    metres = (0.5 + whole.astype(np.float32) / 1000).clip(0, 9)
    metres[0, 0] = 0
    inverse = compressed_depth(topic, START_NS, metres, (10100.0, 1 - 1010.0))
    read = next(open_recording(write_bag(tmp_path / "inverse", [*entries, inverse], "ros1")).frames()).read_depth()
    assert read[0, 0] == 0
    # A step of the inverse depth p is Z^2 / A, and it was rounded to the nearest.
    assert (np.abs(read - metres)[1:] <= 0.51 * metres[1:] ** 2 / 10100).all()


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("/camera/infra1", "/camera/infra2"),
        ("/zed/zed_node/left", "/zed/zed_node/right"),
        ("/cam0", "/cam1"),
    ],
)
def test_pairs_are_found_by_their_names(tmp_path, left, right):
    entries = stereo(2, left=left, right=right)
    entries += [image("/thermal/image", START_NS, picture(1, channels=1), "mono8")]
    recording = open_recording(write_bag(tmp_path / "row", entries, "mcap"))
    assert recording.roles.left == f"{left}/image_rect_color"
    assert recording.roles.right == f"{right}/image_rect_color"


def test_of_all_that_realsense_publishes_aligned_colour_is_taken(tmp_path):
    """Somebody who switched the alignment on wants the colour; without it the infrared pair has its own depth."""
    depth = picture(1, channels=1, dtype=np.uint16)
    infrared = stereo(1, left="/camera/infra1", right="/camera/infra2")
    plain = [
        info("/camera/depth/camera_info", START_NS),
        image("/camera/depth/image_rect_raw", START_NS, depth, "16UC1"),
    ]
    bag = write_bag(tmp_path / "aligned", infrared + plain + rgbd([depth]), "mcap")
    assert open_recording(bag).roles.pictures == {
        "left": "/camera/color/image_raw",
        "depth": "/camera/aligned_depth_to_color/image_raw",
    }
    colour = [entry for entry in rgbd([depth]) if "aligned" not in entry[0]]
    recording = open_recording(write_bag(tmp_path / "plain", infrared + plain + colour, "mcap"))
    assert recording.roles.left == "/camera/infra1/image_rect_color"
    assert recording.roles.depth == "/camera/depth/image_rect_raw"


def test_rectified_colour_is_taken_before_raw(tmp_path):
    entries = stereo(2)
    for side in ("left", "right"):
        entries.append(image(f"/stereo/{side}/image_raw", START_NS, picture(1), "bgr8"))
        entries.append(image(f"/stereo/{side}/image_rect", START_NS, picture(1, channels=1), "mono8"))
        jpeg = cv2.imencode(".jpg", picture(1))[1].tobytes()
        entries.append(compressed(f"/stereo/{side}/image_rect_color/compressed", START_NS, "jpeg", jpeg))
    assert open_recording(write_bag(tmp_path / "row", entries, "mcap")).roles.left == "/stereo/left/image_rect_color"


def test_two_cameras_are_not_guessed(tmp_path):
    entries = stereo(2, left="/front/left", right="/front/right") + stereo(2, left="/rear/left", right="/rear/right")
    bag = write_bag(tmp_path / "row", entries, "sqlite3")
    refused(bag, "/front/left/image_rect_color, /front/right/image_rect_color, /rear/left", "choose with --topics")
    topics = {"left": "/rear/left/image_rect_color", "right": "/rear/right/image_rect_color"}
    recording = open_recording(bag, topics=topics)
    assert recording.roles.right_info == "/rear/right/camera_info"
    assert np.array_equal(next(recording.frames()).read_right(), picture(1000))
    refused(bag, "left: found no topic /side", topics={"left": "/side"})


def test_a_bag_without_pictures_says_what_it_has(tmp_path):
    bag = write_bag(tmp_path / "row", [info("/a/camera_info", START_NS)], "mcap")
    refused(bag, "found no pictures, but /a/camera_info (sensor_msgs/msg/CameraInfo), expected sensor_msgs/msg/Image")


def test_pairs_are_made_by_time(tmp_path):
    entries = [
        entry for entry in stereo(6, late_ns=20_000_000) if not (entry[0].endswith("color") and "left" in entry[0])
    ]
    lefts = [entry for entry in stereo(6) if entry[0] == "/stereo/left/image_rect_color"]
    entries += [entry for row, entry in enumerate(lefts) if row != 2]
    with pytest.warns(PomonaWarning, match="found 5 left, 6 right pictures, 5 frames have all of them"):
        recording = open_recording(write_bag(tmp_path / "row", entries, "ros1"))
    assert [recording.rows["left"].tolist(), recording.rows["right"].tolist()] == [[0, 1, 2, 3, 4], [0, 1, 3, 4, 5]]
    for frame, row in zip(recording.frames(), (0, 1, 3, 4, 5), strict=True):
        assert np.array_equal(frame.read_left(), picture(row))
        assert np.array_equal(frame.read_right(), picture(1000 + row))


def test_pictures_that_arrive_late_still_find_their_partner(tmp_path):
    """The recorder got the right pictures half a second after they were taken: headers count, not the log."""
    entries = [
        (topic, at + 500_000_000 if topic == "/stereo/right/image_rect_color" else at, kind, fields)
        for topic, at, kind, fields in stereo(12)
    ]
    recording = open_recording(write_bag(tmp_path / "row", entries, "mcap"))
    assert len(recording) == 12
    assert all(np.array_equal(frame.read_right(), picture(1000 + frame.number)) for frame in recording.frames())


def test_cameras_of_different_clocks_are_refused(tmp_path):
    bag = write_bag(tmp_path / "row", stereo(3, late_ns=10**12), "mcap")
    refused(bag, "found no pictures within half a frame")


def test_times_that_go_back_are_refused(tmp_path):
    entries = stereo(5)
    lefts = [entry for entry in entries if entry[0] == "/stereo/left/image_rect_color"]
    lefts[3][3]["stamp_ns"] = START_NS + 50_000_000
    bag = write_bag(tmp_path / "row", entries, "sqlite3")
    refused(bag, "/stereo/left/image_rect_color: picture 3: time goes back from 1723190400.200 s to 1723190400.050 s")


def test_empty_headers_fall_back_on_the_log(tmp_path):
    entries = stereo(3)
    for entry in entries:
        entry[3]["stamp_ns"] = 0
    recording = open_recording(write_bag(tmp_path / "row", entries, "ros1"))
    assert [frame.time_s for frame in recording.frames()] == pytest.approx(
        [START_NS / 1e9 + 0.1 * row for row in range(3)]
    )


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


def test_a_part_of_a_bag_and_other_threads(tmp_path):
    for form in ("ros1 lz4", "sqlite3", "mcap"):
        recording = open_recording(write_bag(tmp_path / "row", stereo(70), form))
        for numbers in ([0, 60], [3], [66, 67, 69], range(0, 70, 7)):
            frames = list(recording.frames(numbers))
            assert [frame.number for frame in frames] == list(numbers)
            assert all(np.array_equal(frame.read_left(), picture(frame.number)) for frame in frames)
        found = {}

        def read(found=found, recording=recording):
            found.update({frame.number: frame for frame in selected(recording, every=3).frames()})

        thread = threading.Thread(target=read)
        thread.start()
        thread.join()
        assert all(np.array_equal(frame.read_right(), picture(1000 + number)) for number, frame in found.items())
        assert len(found) == 24


def test_a_corrupt_picture_in_the_middle_is_counted_and_named(tmp_path):
    entries = [entry for entry in stereo(4) if "image" not in entry[0]]
    for row in range(4):
        at = START_NS + row * STEP_NS
        for side in ("left", "right"):
            content = cv2.imencode(".jpg" if row % 2 else ".png", picture(row))[1].tobytes()
            cut = content[:-30] if side == "left" and row in (1, 2) else content
            entries.append(compressed(f"/stereo/{side}/image_rect/compressed", at, "jpeg", cut))
    bad = unreadable_frames(open_recording(write_bag(tmp_path / "row", entries, "ros1")))
    assert list(bad) == [1, 2]
    assert "/stereo/left/image_rect/compressed: picture 1: the JPEG is cut off" in bad[1]


def test_a_picture_of_another_size_or_too_few_bytes(tmp_path):
    entries = stereo(4)
    lefts = [entry for entry in entries if entry[0] == "/stereo/left/image_rect_color"]
    lefts[1][3].update(image("", 0, picture(1, (32, 24)), "bgr8")[3] | {"stamp_ns": lefts[1][3]["stamp_ns"]})
    lefts[2][3]["data"] = lefts[2][3]["data"][:100]
    bad = unreadable_frames(open_recording(write_bag(tmp_path / "row", entries, "sqlite3")))
    assert list(bad) == [1, 2]
    assert "found 32x24 pixels, expected 64x48 as the first one" in bad[1]
    assert "found 100 bytes" in bad[2]


@pytest.mark.filterwarnings("ignore:.*others are left out")
def test_an_mcap_cut_off_in_the_middle_is_used_as_far_as_it_goes(pomona, tmp_path):
    bag = write_bag(tmp_path / "row", stereo(40), "mcap")
    bag.write_bytes(bag.read_bytes()[: bag.stat().st_size * 2 // 3])
    with pytest.warns(PomonaWarning, match=r"row\.mcap: cut off: what is there is used"):
        recording = open_recording(bag)
    assert 15 < len(recording) < 30
    assert all(np.array_equal(frame.read_left(), picture(frame.number)) for frame in recording.frames())
    code, _, errors = pomona("info", bag)
    assert code == 0
    assert "row.mcap: cut off: what is there is used" in errors


@pytest.mark.parametrize("form", ["mcap", "mcap lz4"])
def test_a_damaged_chunk_costs_its_own_pictures(tmp_path, form):
    bag = write_bag(tmp_path / "row", stereo(40), form)
    piece = mcap_file.McapFile.open(bag).pieces[10]
    content = bytearray(bag.read_bytes())
    middle = piece.offset + piece.length // 2
    content[middle : middle + 50] = bytes(byte ^ 0xFF for byte in content[middle : middle + 50])
    bag.write_bytes(content)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        recording = open_recording(bag)
        lefts = {frame.number: frame.read_left() for frame in recording.frames()}
    assert sum("is damaged and left out" in str(warning.message) for warning in caught) == 1
    assert 34 <= len(lefts) < 40
    originals = [picture(row) for row in range(40)]
    assert all(any(np.array_equal(left, original) for original in originals) for left in lefts.values())


@pytest.mark.filterwarnings("ignore:.*others are left out")
@pytest.mark.parametrize("form", ["ros1", "ros1 lz4", "sqlite3"])
@pytest.mark.parametrize("share", [0.4, 0.7])
def test_a_ros_bag_cut_off_in_the_middle_is_used_as_far_as_it_goes(pomona, tmp_path, form, share):
    """Of ROS 1 the index is lost; rosbag1 writes chunks of 1 MB, so the pictures are large enough for some of them."""
    size = (640, 360)
    entries = []
    for row in range(20):
        at = START_NS + row * STEP_NS
        for side, shift, changed in (("left", 0.0, 0), ("right", -600 * 0.12, OTHER_EYE)):
            entries.append(info(f"/{side}/camera_info", at, shift, size=size, f=600.0))
            entries.append(image(f"/{side}/image_rect", at, picture(row, size) ^ changed, "bgr8"))
    bag = write_bag(tmp_path / "row", entries, form)
    file = bag if bag.is_file() else next(bag.glob("*.db3"))
    with file.open("rb+") as content:
        content.truncate(int(share * file.stat().st_size))
    with pytest.warns(PomonaWarning, match="cut off.*: what is there is used"):
        recording = open_recording(bag)
    assert abs(len(recording) - 20 * share) <= 3
    for frame in recording.frames():
        assert np.array_equal(frame.read_left(), picture(frame.number, size))
        assert np.array_equal(frame.read_right(), picture(frame.number, size) ^ OTHER_EYE)
    code, printed, errors = pomona("info", bag, "--check")
    assert (code, errors.count("cut off")) == (0, 1)
    assert "unreadable     0" in printed


@pytest.mark.parametrize("name", ["row.bag", "row.bag.active"])
def test_a_bag_that_was_never_closed(tmp_path, name):
    """The recorder writes the place of the index when it closes the bag."""
    bag = write_bag(tmp_path / "closed", stereo(4), "ros1")
    content = bytearray(bag.read_bytes())
    place = content.index(b"index_pos=") + len(b"index_pos=")
    content[place : place + 8] = bytes(8)
    (tmp_path / name).write_bytes(content)
    with pytest.warns(PomonaWarning, match="not closed"):
        recording = open_recording(tmp_path / name)
    assert all(np.array_equal(frame.read_left(), picture(frame.number)) for frame in recording.frames([1, 2, 3]))
    assert len(recording) == 4


def test_a_damaged_chunk_of_a_bag_without_index(tmp_path):
    bag = write_bag(tmp_path / "closed", stereo(200), "ros1 lz4")
    content = bytearray(bag.read_bytes())
    place = content.index(b"index_pos=") + len(b"index_pos=")
    content[place : place + 8] = bytes(8)
    magic = b"\x04\x22\x4d\x18"  # of an LZ4 frame; the format has no checksums, so only its structure can be broken
    second = content.index(magic, content.index(magic) + 1)
    content[second : second + 8] = bytes(8)
    bag.write_bytes(content)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        recording = open_recording(bag)
    assert sum("is damaged and left out" in str(warning.message) for warning in caught) == 1
    assert 50 < len(recording) < 200


def test_a_damaged_chunk_of_a_closed_bag(tmp_path):
    bag = write_bag(tmp_path / "row", stereo(200), "ros1 lz4")
    content = bytearray(bag.read_bytes())
    magic = b"\x04\x22\x4d\x18"
    second = content.index(magic, content.index(magic) + 1)
    content[second : second + 8] = bytes(8)
    bag.write_bytes(content)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        recording = open_recording(bag)
        frames = list(recording.frames())
    assert sum("is damaged and left out" in str(warning.message) for warning in caught) == 1
    assert 50 < len(recording) == len(frames) < 200
    assert unreadable_frames(recording) == {}


@pytest.mark.filterwarnings("ignore:.*others are left out")
def test_a_damaged_page_of_a_database(tmp_path):
    """Rows are read up to the damage, which lies behind three quarters of them."""
    bag = write_bag(tmp_path / "row", stereo(200), "sqlite3")
    file = next(bag.glob("*.db3"))
    content = bytearray(file.read_bytes())
    place = len(content) * 3 // 4 // 4096 * 4096
    content[place : place + 3 * 4096] = b"\xff" * (3 * 4096)
    file.write_bytes(content)
    with pytest.warns(PomonaWarning, match="cut off or damaged: what is there is used"):
        recording = open_recording(bag)
    assert 140 <= len(recording) <= 155
    for frame in recording.frames():
        assert np.array_equal(frame.read_left(), picture(frame.number))


@pytest.mark.parametrize("form", ["ros1", "sqlite3", "mcap"])
def test_what_is_no_bag_is_refused(tmp_path, form):
    bag = write_bag(tmp_path / "row", stereo(1), form)
    file = bag if bag.is_file() else next(bag.glob("*.db3"))
    file.write_bytes(b"no bag at all" * 20)
    refused(bag, "row", "not a")


@pytest.mark.parametrize("form", ["sqlite3 zstd message", "sqlite3 zstd file", "ros2 mcap zstd message"])
def test_what_the_recorder_compressed(tmp_path, form):
    recording = open_recording(write_bag(tmp_path / "row", stereo(3), form))
    assert len(recording) == 3
    for frame in recording.frames():
        assert np.array_equal(frame.read_left(), picture(frame.number))
        assert np.array_equal(frame.read_right(), picture(1000 + frame.number))


def test_a_split_bag_is_one_recording(tmp_path):
    """The parts of a recorder that was killed: no metadata.yaml, and part 10 after part 9."""
    (tmp_path / "row").mkdir()
    entries = stereo(12)
    for part in range(12):
        some = [entry for entry in entries if entry[3]["stamp_ns"] == START_NS + part * STEP_NS]
        write_bag(tmp_path / "row" / f"row_{part}", some, "mcap")
    recording = open_recording(tmp_path / "row")
    assert len(recording) == 12
    assert all(np.array_equal(frame.read_left(), picture(frame.number)) for frame in recording.frames([0, 9, 10, 11]))


def test_several_bags_are_not_joined(tmp_path):
    (tmp_path / "day").mkdir()
    for name in ("morning", "evening"):
        write_bag(tmp_path / "day" / name, stereo(1), "mcap")
    refused(tmp_path / "day", "found evening.mcap, morning.mcap, expected one bag, or the parts of one")


def test_without_the_libraries_the_extra_is_named(tmp_path, monkeypatch):
    for form, module in (("ros1", "rosbags"), ("mcap", "mcap")):
        bag = write_bag(tmp_path / "row", stereo(1), form)
        monkeypatch.setitem(sys.modules, module, None)
        refused(bag, "pip install mcap rosbags")


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
@pytest.mark.parametrize("form", ["ros1 lz4", "sqlite3", "mcap"])
def test_memory_does_not_grow_with_the_length(tmp_path, form):
    """Read 120 pairs of 0.7 MB a picture in a process of its own: 90 of them after the first measurement, 124 MB."""
    size = (640, 360)
    entries = []
    same = {side: picture(row, size) for row, side in enumerate(("left", "right"))}
    for row in range(120):
        at = START_NS + row * STEP_NS
        entries += [image(f"/{side}/image_rect", at, pixels, "bgr8") for side, pixels in same.items()]
        entries.append(info("/left/camera_info", at, size=size, f=600.0))
        entries.append(info("/right/camera_info", at, -600 * 0.12, size=size, f=600.0))
    bag = write_bag(tmp_path / "row", entries, form)
    program = """
import re, sys
from pathlib import Path
from pomona.recording import open_recording
# Not ru_maxrss: that begins with the memory of the process that started this one.
peak = lambda: int(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024
for frame in open_recording(sys.argv[1]).frames():
    frame.read_left(), frame.read_right()
    if frame.number == 30:
        early = peak()
print(peak() - early)
"""
    done = subprocess.run([sys.executable, "-c", program, bag], capture_output=True, text=True, check=True)
    assert float(done.stdout) < 30
