"""Bags that are cut off, damaged or none at all."""

import warnings

import cv2
import numpy as np
import pytest

from bag_maker import (
    START_NS,
    STEP_NS,
    compressed,
    image,
    info,
    picture,
    refused,
    stereo,
    write_bag,
)
from pomona import PomonaWarning
from pomona.recording import open_recording
from pomona.recording.bags import mcap_file
from pomona.recording.checks.readable import checked

OTHER_EYE = np.uint8(64)
"""What the right pictures differ by: a pair of one picture is refused."""


def test_a_corrupt_picture_in_the_middle_is_counted_and_named(tmp_path):
    entries = [entry for entry in stereo(4) if "image" not in entry[0]]
    for row in range(4):
        at = START_NS + row * STEP_NS
        for side in ("left", "right"):
            content = cv2.imencode(".jpg" if row % 2 else ".png", picture(row))[1].tobytes()
            cut = content[:-30] if side == "left" and row in (1, 2) else content
            entries.append(compressed(f"/stereo/{side}/image_rect/compressed", at, "jpeg", cut))
    bad = checked(open_recording(write_bag(tmp_path / "row", entries, "ros1"))).unreadable
    assert list(bad) == [1, 2]
    assert "/stereo/left/image_rect/compressed: picture 1: the JPEG is cut off" in bad[1]


def test_a_picture_of_another_size_or_too_few_bytes(tmp_path):
    entries = stereo(4)
    lefts = [entry for entry in entries if entry[0] == "/stereo/left/image_rect_color"]
    lefts[1][3].update(image("", 0, picture(1, (32, 24)), "bgr8")[3] | {"stamp_ns": lefts[1][3]["stamp_ns"]})
    lefts[2][3]["data"] = lefts[2][3]["data"][:100]
    bad = checked(open_recording(write_bag(tmp_path / "row", entries, "sqlite3"))).unreadable
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
def test_an_mcap_cut_off_whose_pictures_fill_a_chunk_each_knows_all_topics(tmp_path, form):
    """A writer tells a type once, in the chunk of the topic that came first; later chunks only name it."""
    size = (320, 240)
    entries = []
    for row in range(6):
        at = START_NS + row * STEP_NS
        for side, shift, changed in (("left", 0.0, 0), ("right", -60 * 0.12, OTHER_EYE)):
            entries.append(info(f"/{side}/camera_info", at, shift, size=size))
            entries.append(image(f"/{side}/image_rect", at, picture(row, size) ^ changed, "bgr8"))
    bag = write_bag(tmp_path / "row", entries, form)
    bag.write_bytes(bag.read_bytes()[: bag.stat().st_size * 2 // 3])
    with pytest.warns(PomonaWarning, match="cut off"):
        recording = open_recording(bag)
    assert 3 <= len(recording) <= 4
    for frame in recording.frames():
        assert np.array_equal(frame.read_right(), picture(frame.number, size) ^ OTHER_EYE)


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
    assert checked(recording).unreadable == {}


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
