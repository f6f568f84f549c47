"""What people bring by mistake, through `pomona info --check`: one clear line each, whatever the kind of recording."""

import json
import re
import shutil

import cv2
import numpy as np
import pytest

from bag_maker import START_NS, STEP_NS, image, info, write_bag
from pomona.recording import open_recording
from pomona.recording.checks.readable import checked, is_blank
from pomona.recording.checks.swapped import check_sides
from pomona.recording.pictures import UnreadablePictureError
from test_recording_video import write_calibration

SIZE = (320, 240)
DISPARITY = 12


def leaves(seed=0, shift=0):
    """A picture with corners everywhere, moved to the left by `shift`."""
    rng = np.random.default_rng(seed)
    wide = rng.integers(0, 256, (SIZE[1] // 4, SIZE[0] // 4 + 8, 3)).astype(np.uint8)
    wide = cv2.resize(wide, None, fx=4, fy=4, interpolation=cv2.INTER_CUBIC)
    return np.ascontiguousarray(wide[:, shift : shift + SIZE[0]])


def seen_by_another(picture):
    """The same view by another camera: a little darker, and noise of its own."""
    noise = np.random.default_rng(2).normal(0.0, 6.0, picture.shape)
    return np.clip(0.8 * picture + noise, 0, 255).astype(np.uint8)


def pairs(n_frames=6, *, swapped=False):
    """What a pair of cameras sees at one distance: to the right one everything is farther left."""
    both = [(leaves(row), leaves(row, DISPARITY)) for row in range(n_frames)]
    return [(right, left) for left, right in both] if swapped else both


def write_folder(folder, frames):
    for side in ("left", "right"):
        (folder / side).mkdir(parents=True)
    for row, (left, right) in enumerate(frames):
        cv2.imwrite(str(folder / "left" / f"{row:04d}.png"), left)
        cv2.imwrite(str(folder / "right" / f"{row:04d}.png"), right)
    size = {"width": SIZE[0], "height": SIZE[1], "fx": 300.0, "fy": 300.0, "cx": 160.0, "cy": 120.0}
    write_calibration(folder, **size)
    return folder


def write_video_of(folder, frames):
    import av

    folder.mkdir()
    size = {"width": SIZE[0], "height": SIZE[1], "fx": 300.0, "fy": 300.0, "cx": 160.0, "cy": 120.0}
    write_calibration(folder, **size)
    with av.open(str(folder / "row.mkv"), "w") as container:
        stream = container.add_stream("ffv1", rate=10)
        stream.width, stream.height, stream.pix_fmt = 2 * SIZE[0], SIZE[1], "bgr0"
        for left, right in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.hstack([left, right]), format="bgr24")))
        container.mux(stream.encode(None))
    return folder / "row.mkv"


def write_bag_of(folder, frames):
    entries = []
    for row, sides in enumerate(frames):
        at = START_NS + row * STEP_NS
        for side, picture, shift in zip(("left", "right"), sides, (0, -300 * 0.12), strict=True):
            entries.append(info(f"/{side}/camera_info", at, shift, f=300.0, size=SIZE))
            entries.append(image(f"/{side}/image_rect", at, picture, "bgr8"))
    return write_bag(folder, entries, "mcap")


def test_a_damaged_png_is_named_and_its_decoder_mutters_nothing(tmp_path, capfd):
    folder = write_folder(tmp_path / "row", pairs(2))
    picture = folder / "left" / "0001.png"
    content = bytearray(picture.read_bytes())
    content[len(content) // 2] ^= 0xFF
    picture.write_bytes(content)
    frames = list(open_recording(folder).frames())
    assert frames[0].read_left().shape == (SIZE[1], SIZE[0], 3)
    with pytest.raises(UnreadablePictureError, match=r"0001\.png: the PNG is damaged: a checksum is wrong"):
        frames[1].read_left()
    assert capfd.readouterr().err == ""


WRITERS = {"folder": write_folder, "video": write_video_of, "bag": write_bag_of}


@pytest.mark.parametrize("kind", WRITERS)
def test_swapped_sides_are_said(pomona, tmp_path, kind):
    code, printed, errors = pomona("info", WRITERS[kind](tmp_path / "swapped", pairs(swapped=True)), "--check")
    assert (code, printed) == (2, "")
    assert "left and right are swapped, or not of one time: found" in errors
    assert errors.count("\n") == 1
    code, printed, errors = pomona("info", WRITERS[kind](tmp_path / "right", pairs()), "--check")
    assert code == 0, errors
    assert "unreadable     0\nblank          0\n" in printed


@pytest.mark.parametrize("quality", [95, 50])
def test_one_eye_given_twice_is_said_however_it_was_compressed(pomona, tmp_path, quality):
    """Each half of a side-by-side video is compressed by itself."""

    def compressed(picture, row):
        written = cv2.imencode(".jpg", np.roll(picture, row, 0), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        return np.roll(cv2.imdecode(written, cv2.IMREAD_COLOR), -row, 0)

    twice = [(compressed(left, 1), compressed(left, 4)) for left, _ in pairs()]
    code, printed, errors = pomona("info", write_folder(tmp_path / "twice", twice), "--check")
    assert (code, printed) == (2, "")
    assert "found the same picture in 5 of 5 frames that were compared, expected those of two cameras" in errors


@pytest.mark.parametrize("quarters", [1, 3])
def test_pictures_turned_by_a_quarter_are_said(pomona, tmp_path, quarters):
    """The eyes lie above each other then, and nothing that is seen has a depth."""
    turned = [[np.ascontiguousarray(np.rot90(side, quarters)) for side in both] for both in pairs()]
    folder = write_folder(tmp_path / "turned", turned)
    write_calibration(folder, width=SIZE[1], height=SIZE[0], fx=300.0, fy=300.0, cx=120.0, cy=160.0)
    code, printed, errors = pomona("info", folder, "--check")
    assert (code, printed) == (2, "")
    assert re.search(r"turned by a quarter: found \d+ corners above or below each other in both, \d+ beside", errors)
    assert errors.count("\n") == 1


def test_sides_of_the_rendered_rows_and_of_a_car(shared_data, tmp_path):
    for name in ("rendered_row/2024-08-09", "rendered_row/2024-08-28", "kitti_stereo"):
        check_sides(open_recording(shared_data / name))
        swapped = shutil.copytree(shared_data / name, tmp_path / name)
        left, right = ("image_l", "image_r") if "kitti" in name else ("left", "right")
        (swapped / left).rename(swapped / "other")
        (swapped / right).rename(swapped / left)
        (swapped / "other").rename(swapped / right)
        with pytest.raises(Exception, match="left and right are swapped"):
            check_sides(open_recording(swapped))


@pytest.mark.parametrize(
    "frames",
    [
        pairs(1)[:1],
        [(leaves(1), leaves(2))] * 3,  # nothing in common
        [(leaves(1), seen_by_another(leaves(1)))] * 3,  # all at infinity, seen by two cameras
        [(np.zeros((SIZE[1], SIZE[0], 3), np.uint8),) * 2] * 3,  # a covered lens
    ],
    ids=["one frame", "strangers", "infinity", "black"],
)
def test_what_says_nothing_is_let_through(tmp_path, frames):
    check_sides(open_recording(write_folder(tmp_path / "row", frames)))


def test_pictures_of_three_pixels_say_nothing(tmp_path):
    row = write_folder(tmp_path / "row", [(leaves(1)[:3, :3], leaves(2)[:3, :3])] * 3)
    write_calibration(row, width=3, height=3, fx=3.0, fy=3.0, cx=1.5, cy=1.5)
    check_sides(open_recording(row))


def test_sides_are_found_out_beside_frames_that_cannot_be_read(tmp_path):
    row = write_folder(tmp_path / "row", pairs(5, swapped=True))
    for number in (0, 1, 2, 3):
        (row / "left" / f"{number:04d}.png").write_bytes(b"")
    with pytest.raises(Exception, match="left and right are swapped"):
        check_sides(open_recording(row))


@pytest.mark.parametrize("kind", WRITERS)
def test_black_frames_are_named(pomona, tmp_path, kind):
    frames = pairs()
    black = np.random.default_rng(1).integers(0, 6, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
    frames[2] = (black, black)
    frames[4] = (frames[4][0], np.full_like(black, 255))
    recording = WRITERS[kind](tmp_path / "row", frames)
    found = checked(open_recording(recording))
    assert list(found.blank) == [2, 4]
    assert "frame 2: the left picture shows nothing: grey level" in found.blank[2]
    assert "frame 4: the right picture shows nothing: grey level 255 of 255 all over" in found.blank[4]
    code, printed, _ = pomona("info", recording, "--check", "--json")
    assert code == 0
    assert [each["frame"] for each in json.loads(printed)["blank"]] == [2, 4]


def test_a_dim_picture_is_not_blank():
    assert not is_blank(leaves() // 12)
    assert not is_blank(cv2.GaussianBlur(leaves(), (0, 0), 8))
    assert is_blank(leaves() // 100)


def test_pictures_of_another_size_cost_their_frame(pomona, tmp_path):
    row = write_folder(tmp_path / "row", pairs())
    cv2.imwrite(str(row / "right" / "0003.png"), leaves()[:100])
    code, printed, _ = pomona("info", row, "--check")
    assert code == 1
    assert "0003.png: found 320x100 pixels, expected 320x240 as in the calibration" in printed


def test_a_picture_that_is_not_there_costs_its_frame(pomona, tmp_path):
    row = write_folder(tmp_path / "row", pairs())
    (row / "right" / "0005.png").unlink()
    code, printed, _ = pomona("info", row, "--check")
    assert code == 1
    assert "0005.png: not there, but the other pictures of this frame are" in printed


def test_folders_that_share_no_frame(pomona, tmp_path):
    row = write_folder(tmp_path / "row", pairs())
    for file in sorted((row / "right").iterdir()):
        file.rename(file.with_name(f"1{file.name}"))
    code, _, errors = pomona("info", row)
    assert code == 2
    assert "expected the same numbers in each folder" in errors


def test_depth_in_floating_point_is_named(pomona, tmp_path):
    for name in ("left", "depth"):
        (tmp_path / name).mkdir()
    for row in range(3):
        cv2.imwrite(str(tmp_path / f"left/{row:04d}.png"), leaves(row))
        cv2.imwrite(str(tmp_path / f"depth/{row:04d}.tiff"), np.full(SIZE[::-1], 1.5, np.float32))
    write_calibration(tmp_path)
    code, _, told = pomona("info", tmp_path, "--check")
    assert (code, told.count("\n")) == (2, 1)
    assert "depth: found '0000.tiff', expected 16-bit PNG: depth/0000.png" in told
