"""Which topics of a bag are the cameras, and which of their pictures belong together."""

import cv2
import numpy as np
import pytest

from bag_maker import (
    START_NS,
    compressed,
    image,
    info,
    picture,
    refused,
    rgbd,
    stereo,
    write_bag,
)
from pomona import PomonaWarning
from pomona.recording import open_recording


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
