import json
from pathlib import Path

import numpy as np
import pytest

import onnx_maker
from pomona import PomonaError
from pomona.detect.from_file import FileDetector
from pomona.detect.onnx import OnnxDetector
from pomona.detect.opening import open_detector
from pomona.detect.shipped import SHIPPED, model_named
from pomona.errors import PomonaWarning
from pomona.recording import open_recording
from recording_maker import make_recording


@pytest.fixture
def row(tmp_path):
    """A recording folder with depth, left pictures and boxes."""
    import cv2

    folder = make_recording(tmp_path / "row")
    (folder / "left").mkdir()
    picture = np.zeros((480, 640, 3), np.uint8)
    picture[100:140, 200:260, 2] = 255
    assert cv2.imwrite(str(folder / "left" / "0000.png"), picture)
    return folder


def test_boxes_that_are_named_or_lie_in_the_folder(row):
    recording = open_recording(row)
    detector = open_detector(None, None, recording)
    assert isinstance(detector, FileDetector)
    assert detector.path == row / "detections.csv"
    assert detector.description.endswith("detections.csv: 3 boxes with ids in 1 frame")
    assert json.loads(json.dumps(detector.configuration)) == {"detections": str((row / "detections.csv").resolve())}
    (row / "other.txt").write_text("1,-1,10,20,30,40,0.5\n")
    other = open_detector(row / "other.txt", None, recording)
    assert [len(other(frame)) for frame in recording.frames()] == [1]
    assert other.description.endswith("other.txt: 1 box in 1 frame")


def test_a_model_with_settings(row):
    recording = open_recording(row)
    model = onnx_maker.yolov8(row / "apples.onnx", 320, 256)
    detector = open_detector(None, model, recording, min_score=0.5, tiles=None, classes=(0,))
    assert isinstance(detector, OnnxDetector)
    found = [detector(frame).boxes_px.tolist() for frame in recording.frames()]
    assert found == [[[200, 100, 260, 140]]]
    assert json.loads(json.dumps(detector.configuration)) == {
        "model": str(model.resolve()),
        "family": "yolov8",
        "size_px": [320, 256],
        "min_score": 0.5,
        "iou": 0.6,
        "classes": [0],
        "class_agnostic": True,
        "tiles": "auto",
        "augment": False,
    }
    assert detector.path == model


def test_what_does_not_go_together_is_told(row):
    recording = open_recording(row)
    with pytest.raises(PomonaError, match=r"found --detections .* and --model .*, expected one of them"):
        open_detector(row / "detections.csv", row / "apples.onnx", recording)
    with pytest.raises(PomonaError, match="min_score: found without a model, expected --model FILE"):
        open_detector(None, None, recording, min_score=0.5)
    with pytest.raises(PomonaError, match="augment: found without a model, expected --model FILE"):
        open_detector(None, None, recording, augment=True)
    model = onnx_maker.yolov8(row / "apples.onnx", 320, 256)
    with pytest.raises(
        PomonaError, match=r"apples.onnx: augment: found yolov8 with an input of 320x256, expected a network that"
    ):
        open_detector(None, model, recording, augment=True)
    (row / "detections.csv").unlink()
    (row / "left" / "0000.png").unlink()
    (row / "left").rmdir()
    with pytest.raises(PomonaError, match="found depth pictures, expected left ones"):
        open_detector(None, row / "apples.onnx", open_recording(row))
    with pytest.raises(PomonaError, match="found depth pictures, expected left ones"):
        open_detector(None, None, open_recording(row))


def test_the_shipped_model_looks_where_there_are_no_boxes(row):
    recording = open_recording(row)
    named = open_detector(None, Path("shipped"), recording)
    (row / "detections.csv").unlink()
    found = open_detector(None, None, recording, min_score=0.5)
    assert isinstance(found, OnnxDetector)
    assert isinstance(named, OnnxDetector)
    assert found.path == named.path == model_named(SHIPPED)
    assert found.signature.family == "pomona"
    assert found.selection.min_score == 0.5
    assert 0 < named.selection.min_score < 1


def test_pictures_without_colour_are_told_where_the_shipped_model_looks(row):
    import cv2

    (row / "detections.csv").unlink()
    grey = np.tile(np.arange(640, dtype=np.uint8)[None, :, None], (480, 1, 3))
    grey[..., 0] ^= 7  # as H.264 leaves it
    assert cv2.imwrite(str(row / "left" / "0000.png"), grey)
    with pytest.warns(
        PomonaWarning,
        match="the pictures have no colour, and the detector that is inside finds few fruits so: give --model",
    ):
        open_detector(None, None, open_recording(row))
    # A model of one's own may have learnt from such pictures: no warning, which would be an error here.
    open_detector(None, model_named(SHIPPED), open_recording(row))
