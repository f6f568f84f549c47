import shutil

import pytest

from pomona import PomonaError
from pomona.detect.from_file import FileDetector
from pomona.recording import open_recording
from pomona.recording.formats.kinect_apples import import_captures


def test_every_capture_becomes_a_recording(shared_data, tmp_path):
    captures = list(import_captures(shared_data / "kinect_apples", tmp_path / "out"))
    assert [capture.folder.name for capture in captures] == ["114012", "115932", "121804", "123505"]
    assert [capture.has_colour for capture in captures] == [False, False, True, True]
    recording = open_recording(captures[2].folder)
    assert recording.date == "2021-09-27T12:18:04"
    frame = next(recording.frames())
    assert frame.read_depth().shape == (1080, 1920)
    assert frame.read_left().shape == (1080, 1920, 3)
    boxes = FileDetector.read(captures[2].folder / "detections.csv", recording.calibration, recording.recorded_numbers)
    assert len(boxes(frame)) == 28
    assert "BALL_060" in boxes(frame).ids
    assert next(open_recording(captures[0].folder).frames()).read_left is None


def test_what_is_there_stays(shared_data, tmp_path):
    (tmp_path / "121804").mkdir()
    with pytest.raises(PomonaError, match="already there"):
        list(import_captures(shared_data / "kinect_apples", tmp_path))
    assert [file.name for file in tmp_path.iterdir()] == ["121804"]


def test_another_day_is_said(shared_data, tmp_path):
    captures = import_captures(shared_data / "kinect_apples", tmp_path / "out", date="2021-10-04")
    assert open_recording(next(captures).folder).date == "2021-10-04T11:40:12"
    with pytest.raises(PomonaError, match="date: found '4 October'"):
        next(import_captures(shared_data / "kinect_apples", tmp_path / "other", date="4 October"))
    assert not (tmp_path / "other").exists()


def test_a_folder_without_captures_is_refused(tmp_path):
    with pytest.raises(PomonaError, match="no captures found"):
        list(import_captures(tmp_path, tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_capture_with_a_wrong_part_leaves_nothing_behind(shared_data, tmp_path):
    source = tmp_path / "source"
    source.mkdir()
    shutil.copyfile(shared_data / "kinect_apples" / "114012_depth.png", source / "114012_depth.png")
    with pytest.raises(PomonaError, match=r"114012_boxes\.csv.*not found"):
        list(import_captures(source, tmp_path / "out"))
    (source / "114012_boxes.csv").write_text("id,x,y\n1,2,3\n")
    with pytest.raises(PomonaError, match=r"114012_boxes\.csv: found 'id,x,y'"):
        list(import_captures(source, tmp_path / "out"))
    assert list((tmp_path / "out").iterdir()) == []
