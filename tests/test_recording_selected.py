"""Parts of recordings: the same pictures as in the whole, and no others."""

import threading
from pathlib import Path

import pytest

from pomona import PomonaError
from pomona.recording import open_recording, selected
from pomona.recording.video import video_file
from recording_maker import make_recording
from test_recording_video import write_calibration, write_video


def hashes(recording) -> dict[int, tuple[bytes, bytes]]:
    return {frame.number: (frame.read_left().tobytes(), frame.read_right().tobytes()) for frame in recording.frames()}


@pytest.fixture
def posed(tmp_path) -> Path:
    return make_recording(tmp_path / "row", (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6))


def test_a_part_has_its_frames_and_poses(posed):
    whole = open_recording(posed)
    part = selected(whole, every=2, first=1, last=5)
    assert part.numbers == (1, 3, 5)
    assert len(part) == 3
    assert [frame.number for frame in part.frames()] == [1, 3, 5]
    assert [frame.session_from_camera[0, 3] for frame in part.frames()] == pytest.approx([0.1, 0.3, 0.5])
    assert part.trajectory.frames.tolist() == [1, 3, 5]
    assert part.trajectory.session_from_camera[:, 0, 3] == pytest.approx([0.1, 0.3, 0.5])
    assert part.description()["frames"] == part.description()["pictures"]["depth"] == 3
    assert part.description()["rate_hz"] == pytest.approx(5)
    assert (part.name, part.date, part.path, part.calibration) == (whole.name, None, posed, whole.calibration)
    assert list(part.inputs()) == list(whole.inputs())


def test_a_part_of_a_part(posed):
    part = selected(selected(open_recording(posed), every=2), first=2)
    assert [frame.number for frame in part.frames()] == [2, 4, 6]
    assert [frame.number for frame in part.frames([4, 5])] == [4]


def test_the_whole_is_the_recording_itself(posed):
    whole = open_recording(posed)
    assert selected(whole) is whole
    assert selected(whole, first=0, last=6) is whole


@pytest.mark.parametrize(
    ("choice", "parts"),
    [
        ({"every": 0}, ("every: found 0, expected 1 or more",)),
        ({"first": 7}, ("found no frame from 7, expected some of 0 to 6",)),
        ({"first": 4, "last": 3}, ("found no frame from 4 to 3",)),
    ],
)
def test_a_part_without_frames_is_refused(posed, choice, parts):
    with pytest.raises(PomonaError) as caught:
        selected(open_recording(posed), **choice)
    assert all(part in str(caught.value) for part in parts)


@pytest.mark.parametrize(
    ("name", "codec"),
    [("row.mp4", "libx264"), ("row.mkv", "libx264"), ("row.ts", "libx264"), ("row.avi", "mjpeg"), ("row.mkv", "mjpeg")],
)
def test_a_part_of_a_video_is_equal_to_the_bit(tmp_path, name, codec):
    write_calibration(tmp_path)
    whole = open_recording(write_video(tmp_path / name, 240, codec=codec, options={"g": "20"}))
    all_pictures = hashes(whole)
    for choice in ({"every": 7}, {"first": 133, "last": 140}, {"every": 101, "first": 9}, {"first": 239}):
        part = hashes(selected(whole, **choice))
        assert part
        assert part == {number: all_pictures[number] for number in part}


def decoded_frames(monkeypatch) -> list[int]:
    """Count what the decoder gives."""
    seen: list[int] = []
    decoded = video_file._decoded
    counted = lambda *given: (seen.append(frame.pts) or frame for frame in decoded(*given))  # noqa: E731
    monkeypatch.setattr(video_file, "_decoded", counted)
    return seen


def test_what_nobody_wants_of_a_video_is_not_decoded(tmp_path, monkeypatch):
    write_calibration(tmp_path)
    seen = decoded_frames(monkeypatch)
    whole = open_recording(write_video(tmp_path / "row.mp4", 400, codec="libx264", options={"g": "20"}))
    assert [frame.number for frame in whole.frames([5, 210, 390])] == [5, 210, 390]
    assert len(seen) <= 3 * 25
    seen.clear()
    intra = open_recording(write_video(tmp_path / "row.avi", 400, codec="mjpeg"))
    assert len(list(selected(intra, every=10).frames())) == len(seen) == 40


def test_frames_are_read_from_another_thread(tmp_path):
    write_calibration(tmp_path)
    whole = open_recording(write_video(tmp_path / "row.mkv", 30, codec="libx264"))
    expected = hashes(whole)
    frames, found = list(whole.frames()), {}

    def read(part):
        for frame in part:
            found[frame.number] = (frame.read_left().tobytes(), frame.read_right().tobytes())

    threads = [threading.Thread(target=read, args=(frames[start::2],)) for start in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == expected
