"""Bags written by rosbags and mcap: what goes in comes out, whatever the format."""

import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from bag_maker import (
    FORMATS,
    SIZE,
    START_NS,
    STEP_NS,
    image,
    info,
    picture,
    refused,
    stereo,
    write_bag,
)
from pomona.recording import open_recording, selected
from pomona.recording.checks.readable import checked


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
    assert checked(recording).unreadable == {}


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
