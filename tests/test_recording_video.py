"""Videos made by real encoders, whole, cut off and damaged."""

import json
import subprocess
import sys
import warnings
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

import refusal
from pomona import PomonaWarning
from pomona.recording import open_recording
from pomona.recording.checks.readable import checked
from recording_maker import FIELDS

SIZE = (64, 48)


def write_video(
    path: Path, n_frames: int = 12, *, size=(128, 48), codec="mjpeg", rate=10, stamps=None, options=None
) -> Path:
    """Encode frames whose left half is brightness 10 n and whose right half is 10 n + 5."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate, options=options or {})
        stream.width, stream.height = size
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, 1000)
        for row in range(n_frames):
            picture = np.full((size[1], size[0], 3), 10 * (row % 24), np.uint8)
            picture[:, size[0] // 2 :] += 5
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24").reformat(format=stream.pix_fmt)
            frame.pts, frame.time_base = (stamps or range(0, 1000 * n_frames, 1000 // rate))[row], Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def write_calibration(folder: Path, **changes) -> None:
    size = dict(zip(("width", "height"), SIZE, strict=True))
    fields = {**FIELDS, **size, "fx": 60.0, "fy": 60.0, "cx": 32.0, "cy": 24.0, "baseline_m": 0.12, **changes}
    (folder / "calibration.json").write_text(json.dumps(fields))


@pytest.fixture
def row(tmp_path):
    write_calibration(tmp_path)
    return tmp_path


def brightness(recording):
    return [(round(f.read_left().mean()), round(f.read_right().mean())) for f in recording.frames()]


def refused(path, *parts):
    refusal.refused(lambda: open_recording(path), *parts)


@pytest.mark.parametrize("name", ["row.mkv", "row.mp4", "row.avi"])
def test_side_by_side_gives_left_and_right(row, name):
    recording = open_recording(write_video(row / name))
    assert len(recording) == 12
    assert recording.description()["kind"] == "side-by-side video"
    assert recording.description()["rate_hz"] == pytest.approx(10)
    for number, (left, right) in enumerate(brightness(recording)):
        assert left == pytest.approx(10 * number, abs=3)
        assert right == pytest.approx(10 * number + 5, abs=3)


def test_times_are_those_of_the_camera(row):
    stamps = [0, 33, 67, 100, 250, 283]
    recording = open_recording(write_video(row / "row.mkv", 6, stamps=stamps))
    assert [frame.time_s for frame in recording.frames()] == pytest.approx([stamp / 1000 for stamp in stamps])


@pytest.mark.parametrize(
    ("name", "codec"), [("row.mp4", "libx264"), ("row.mkv", "libx264"), ("row.ts", "libx264"), ("row.mp4", "mpeg4")]
)
def test_frames_that_are_coded_out_of_order_come_in_order(row, name, codec):
    recording = open_recording(write_video(row / name, codec=codec))
    assert [left for left, _ in brightness(recording)] == pytest.approx([10 * row for row in range(12)], abs=8)


def test_left_and_right_files(row):
    for side in ("left", "right"):
        write_video(row / f"{side}.mkv", size=SIZE)
    recording = open_recording(row)
    assert recording.description()["kind"] == "left and right video"
    frame = next(recording.frames())
    assert frame.read_left().shape == frame.read_right().shape == (48, 64, 3)
    assert checked(recording).unreadable == {}


def test_left_and_right_must_be_of_one_size(row):
    write_video(row / "left.mkv", size=SIZE)
    write_video(row / "right.mkv", size=(64, 32))
    refused(row, "64x48 and 64x32 pixels")


def test_what_has_no_partner_is_left_out_and_told(row):
    write_video(row / "left.mkv", size=SIZE)
    write_video(row / "right.mkv", 11, size=SIZE)
    with pytest.warns(PomonaWarning, match="found 12 and 11 frames, 11 of them taken within half a frame; the others"):
        recording = open_recording(row)
    assert recording.numbers == tuple(range(11))
    # A camera that lost its fourth picture: what comes after it keeps its partner.
    write_video(row / "right.mkv", 11, size=SIZE, stamps=[0, 100, 200, *range(400, 1200, 100)])
    with pytest.warns(PomonaWarning, match="11 of them"):
        recording = open_recording(row)
    assert recording.numbers == (0, 1, 2, *range(4, 12))
    lefts, rights = zip(*brightness(recording), strict=True)
    assert lefts == pytest.approx([10 * number + 2 for number in recording.numbers], abs=5)
    assert rights == pytest.approx([10 * number + 2 for number in range(11)], abs=5)
    assert [frame.number for frame in recording.frames([3, 4, 11])] == [4, 11]


def test_cameras_that_do_not_run_together_are_refused(row):
    write_video(row / "left.mkv", size=SIZE)
    write_video(row / "right.mkv", size=SIZE, stamps=[0, *range(1540, 12500, 1000)])
    refused(row, "found 12 and 12 frames, 1 of them taken within half a frame: 0.050 s")


def test_a_cut_off_video_beside_a_whole_one(row):
    for side in ("left", "right"):
        write_video(row / f"{side}.mkv", 24, size=SIZE)
    video = row / "right.mkv"
    video.write_bytes(video.read_bytes()[: video.stat().st_size // 2])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        recording = open_recording(row)
    assert [str(warning.message).partition(": ")[2][:8] for warning in caught] == ["cut off:", "found 24"]
    assert 6 < len(recording) < 18


def test_the_calibration_must_fit_the_half(row):
    write_video(row / "row.mkv", size=SIZE)
    refused(row / "row.mkv", "found a calibration for 64x48, expected 32x48")
    (row / "calibration.json").unlink()
    refused(row / "row.mkv", "calibration: found none", "ZED SN*.conf")
    write_calibration(row, baseline_m=None)
    refused(write_video(row / "wide.mkv"), "baseline_m: missing")


def test_a_video_cut_off_before_its_index_is_refused(row):
    video = write_video(row / "row.mp4")
    video.write_bytes(video.read_bytes()[:2000])
    refused(video, "row.mp4", "cut off before its index")
    video.write_bytes(b"no video at all")
    refused(video, "row.mp4", "not a video")


def test_of_a_video_cut_off_in_the_middle_the_rest_is_used(row):
    video = write_video(row / "row.mkv", 24)
    video.write_bytes(video.read_bytes()[: video.stat().st_size // 2])
    with pytest.warns(PomonaWarning, match=r"row\.mkv: cut off: found \d+ of 24 frames"):
        recording = open_recording(video)
    assert 6 < len(recording) < 18
    assert len(checked(recording).unreadable) <= 1


@pytest.mark.parametrize("rate", [10, 30])
def test_an_avi_says_how_long_it_was_whatever_its_clock_counts(row, rate):
    stamps = [100 * frame for frame in range(40)]  # ten a second, also where the header says thirty
    video = write_video(row / "row.avi", 40, rate=rate, stamps=stamps)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(open_recording(video)) == 40
    with av.open(str(video)) as container:
        middle = [bytes(packet) for packet in container.demux(video=0) if packet.size][19]
    video.write_bytes(video.read_bytes()[: video.read_bytes().index(middle)])
    with pytest.warns(PomonaWarning, match=r"row\.avi: cut off: found \d+ of (39|40) frames"):
        assert 17 <= len(open_recording(video)) <= 20


def damage(video: Path, row: int) -> None:
    """Overwrite the inside of one packet."""
    with av.open(str(video)) as container:
        packets = [bytes(packet) for packet in container.demux(video=0) if packet.size]
    content = bytearray(video.read_bytes())
    start = content.index(packets[row])
    content[start : start + len(packets[row])] = b"\x00" * len(packets[row])
    video.write_bytes(content)


@pytest.mark.parametrize(("codec", "name"), [("mjpeg", "row.avi"), ("mjpeg", "row.mkv"), ("libx264", "row.mp4")])
def test_a_corrupt_picture_in_the_middle_is_counted_and_named(row, codec, name):
    video = write_video(row / name, codec=codec)
    damage(video, 5)
    recording = open_recording(video)
    assert len(recording) == 12
    bad = checked(recording).unreadable
    # What depends on the damaged picture may be lost with it, what comes before it and other streams may not.
    assert 1 <= len(bad) <= (1 if codec == "mjpeg" else 7)
    if codec == "mjpeg":
        assert list(bad) == [5]
    assert all(f"{name}: frame {number} at {number / 10:.3f} s" in line for number, line in bad.items())
    assert [frame.number for frame in recording.frames()] == list(range(12))
    assert checked(recording).unreadable == bad


def test_times_that_go_back_are_refused(row):
    parts = [write_video(row / f"{part}.ts", codec="libx264").read_bytes() for part in "ab"]
    (row / "row.ts").write_bytes(parts[0] + parts[1])
    refused(row / "row.ts", "packet 12: time goes back")


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
def test_memory_does_not_grow_with_the_length(row):
    """Read 600 pictures of 0.7 MB each in a process of its own."""
    write_calibration(row, width=320, height=720, fx=300, fy=300, cx=160, cy=360)
    write_video(row / "row.mkv", 600, size=(640, 720), codec="mpeg4")
    program = """
import re, sys
from pathlib import Path
from pomona.recording import open_recording
# Not ru_maxrss: that begins with the memory of the process that started this one.
peak = lambda: int(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024
for frame in open_recording(sys.argv[1]).frames():
    frame.read_left(), frame.read_right()
    if frame.number == 60:
        early = peak()
print(peak() - early)
"""
    done = subprocess.run([sys.executable, "-c", program, row / "row.mkv"], capture_output=True, text=True, check=True)
    assert float(done.stdout) < 50


def test_several_videos_are_not_guessed(row):
    write_video(row / "a.mkv")
    assert len(open_recording(row)) == 12
    write_video(row / "b.mkv")
    refused(row, "found 2 videos")


def test_without_pyav_the_extra_is_named(row, monkeypatch):
    write_video(row / "row.mkv")
    monkeypatch.setitem(sys.modules, "av", None)
    refused(row / "row.mkv", "pip install av")


def test_a_video_is_rectified(row):
    """With a calibration that shifts the right camera's centre, the right picture moves by as much."""
    (row / "calibration.json").unlink()
    matrix = "!!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [60., 0., {}, 0., 60., 23.5, 0., 0., 1.]"
    (row / "stereo.yml").write_text(
        f"%YAML:1.0\n---\nM1: {matrix.format(31.5)}\nM2: {matrix.format(35.5)}\n"
        "R: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]\n"
        "T: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [-0.12, 0., 0.]\n"
    )
    recording = open_recording(write_video(row / "row.mkv", 1))
    assert recording.calibration.baseline_m == pytest.approx(0.12)
    frame = next(recording.frames())
    assert frame.read_right().shape == (48, 64, 3)
    assert cv2.absdiff(frame.read_right(), frame.read_left()).max() <= 8
