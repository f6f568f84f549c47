"""Pictures and depth in bags: every encoding that is read."""

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
    picture,
    rgbd,
    stereo,
    write_bag,
)
from pomona.recording import open_recording
from pomona.recording.bags.picture_messages import ENCODINGS

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
