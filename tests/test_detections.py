import json
import sys
import types
from dataclasses import dataclass, field

import numpy as np
import pytest

from depth_scene import CAMERA
from pomona import PomonaError, PomonaWarning
from pomona.detect import Detections
from pomona.detect.from_file import FileDetector
from pomona.detect.opening import open_detections
from pomona.detect.supervision import from_supervision, to_supervision
from pomona.recording import Frame

HEADER = "frame,xmin,ymin,xmax,ymax,score,id"


def read(tmp_path, *lines, numbers=(0, 1)):
    path = tmp_path / "detections.csv"
    path.write_text("\n".join(lines) + "\n")
    return FileDetector.read(path, CAMERA, numbers)


def test_boxes_of_each_frame(tmp_path):
    detector = read(tmp_path, HEADER, "0,10,20,30,45,0.9,a", "1,11,20,31,45,0.8,a", "0,50,60,70.5,80,1,b")
    found = detector(Frame(number=0))
    assert found.boxes_px.tolist() == [[10, 20, 30, 45], [50, 60, 70.5, 80]]
    assert found.scores.tolist() == [0.9, 1.0]
    assert found.ids == ("a", "b")
    assert len(detector(Frame(number=7))) == 0
    assert detector.with_ids


def test_columns_in_any_order_and_others_ignored(tmp_path):
    detector = read(tmp_path, "class,ymax,xmax,ymin,xmin,frame", "apple,45,30,20,10,0")
    found = detector(Frame(number=0))
    assert found.boxes_px.tolist() == [[10, 20, 30, 45]]
    assert found.scores.tolist() == [1.0]
    assert found.ids is None


def test_a_single_frame_needs_no_frame_column(tmp_path):
    detector = read(tmp_path, "id,xmin,ymin,xmax,ymax", "2118,10,20,30,45", numbers=(7,))
    assert detector(Frame(number=7)).ids == ("2118",)
    with pytest.raises(PomonaError, match="expected a header with frame"):
        read(tmp_path, "id,xmin,ymin,xmax,ymax", "2118,10,20,30,45", numbers=(7, 8))


def test_a_header_alone_is_no_fruits(tmp_path):
    detector = read(tmp_path, HEADER)
    assert detector.by_frame == {}
    assert detector.with_ids


def test_a_box_partly_outside_is_cut_at_the_edge(tmp_path):
    found = read(tmp_path, HEADER, "0,-5,20,30,500,0.9,a")(Frame(number=0))
    assert found.boxes_px.tolist() == [[0, 20, 30, 480]]


def test_boxes_mostly_outside_are_told(tmp_path):
    with pytest.warns(PomonaWarning, match=r"line 3: the box 600,20,9000,60 is mostly outside .*, as 1 of 2 boxes are"):
        found = read(tmp_path, HEADER, "0,5,20,30,50,0.9,a", "0,600,20,9000,60,0.9,b")(Frame(number=0))
    assert found.boxes_px.tolist() == [[5, 20, 30, 50], [600, 20, 640, 60]]


@pytest.mark.parametrize(
    ("lines", "parts"),
    [
        ([], ["an empty file", "frame, xmin, ymin, xmax, ymax"]),
        (["frame,x,y,w,h"], ["found frame,x,y,w,h", "xmin, ymin, xmax, ymax"]),
        ([HEADER, "0,10,20,30,45,0.9"], ["line 2", "found 6 cells", "expected 7"]),
        ([HEADER, "0,10,20,3O,45,0.9,a"], ["line 2", "xmax: found '3O'"]),
        ([HEADER, "0,10,20,,45,0.9,a"], ["line 2", "xmax: found ''"]),
        ([HEADER, "0,10,nan,30,45,0.9,a"], ["line 2", "ymin: found 'nan'"]),
        ([HEADER, "", "0,30,20,30,45,0.9,a"], ["line 3", "xmin 30 and xmax 30"]),
        ([HEADER, "0,10,50,30,45,0.9,a"], ["line 2", "ymin 50 and ymax 45"]),
        ([HEADER, "0,700,20,730,45,0.9,a"], ["line 2", "700,20,730,45 is outside the picture of 640x480"]),
        ([HEADER, "0,10,-40,30,0,0.9,a"], ["line 2", "outside the picture"]),
        ([HEADER, "5,10,20,30,45,0.9,a"], ["line 2", "frame: found 5", "0 to 1"]),
        ([HEADER, "0.5,10,20,30,45,0.9,a"], ["line 2", "frame: found 0.5", "whole number"]),
        ([HEADER, "0,10,20,30,45,90,a"], ["line 2", "score: found 90", "0 to 1"]),
        ([HEADER, "0,10,20,30,45,1,a", "0,11,20,30,45,1,a"], ["line 2 and line 3", "'a' twice in frame 0"]),
        ([HEADER, "0,10,20,30,45,1,a", "1,11,20,30,45,1,"], ["line 3", "id: found none"]),
    ],
)
def test_a_wrong_table_is_told_by_line(tmp_path, lines, parts):
    with pytest.raises(PomonaError) as caught:
        read(tmp_path, *lines)
    line = str(caught.value)
    assert "detections.csv" in line
    assert "\n" not in line
    for part in parts:
        assert part in line, line


def test_a_table_that_is_no_text_is_refused(tmp_path):
    (tmp_path / "detections.csv").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(PomonaError, match="byte 0: found bytes that are not UTF-8, expected boxes"):
        FileDetector.read(tmp_path / "detections.csv", CAMERA, (0,))


def test_detections_are_checked_where_they_are_made():
    with pytest.raises(PomonaError, match="xmin >= xmax"):
        Detections([[10, 10, 10, 20]], [1.0])
    with pytest.raises(PomonaError, match="shapes"):
        Detections([[10, 10, 20, 20]], [1.0, 0.5])
    with pytest.raises(PomonaError, match="each once"):
        Detections([[10, 10, 20, 20], [30, 10, 40, 20]], [1.0, 0.5], ids=("a", "a"))
    assert Detections.none().boxes_px.shape == (0, 4)


def read_text(tmp_path, name, text, numbers=(0, 1)):
    path = tmp_path / name
    path.write_text(text)
    return open_detections(path, CAMERA, numbers)


@pytest.mark.parametrize("score", [-0.1, 1.5, np.nan])
def test_scores_are_probabilities(score):
    with pytest.raises(PomonaError, match=r"found scores from .* expected 0 to 1"):
        Detections(np.array([[1.0, 2, 3, 4]] * 2), np.array([0.5, score]))


def test_mot_text_counts_frames_from_one_and_pixels_from_the_corner(tmp_path):
    text = "1,3,10,20,20,25,0.9,-1,-1,-1\n2, 3, 11.5, 20, 20, 25, 0.8, -1, -1, -1\n2,4,50,60,20.5,12,-1,-1,-1,-1\n"
    detector = read_text(tmp_path, "tracks.txt", text, numbers=(100, 200))
    assert sorted(detector.by_frame) == [100, 200]
    found = detector(Frame(number=200))
    assert found.boxes_px.tolist() == [[11.5, 20, 31.5, 45], [50, 60, 70.5, 72]]
    assert found.scores.tolist() == [0.8, 1.0]
    assert found.ids == ("3", "4")


def test_mot_text_without_tracks_or_with_spaces(tmp_path):
    found = read_text(tmp_path, "det.txt", "1 -1 10 20 20 25 0.7\n1 -1 50 60 20 10 0.6\n")(Frame(number=0))
    assert found.ids is None
    assert found.scores.tolist() == [0.7, 0.6]


def test_what_a_ground_truth_ignores_is_left_out(tmp_path):
    detector = read_text(tmp_path, "gt.txt", "1,1,10,20,20,25,1,1,0.86\n1,2,50,60,20,10,0,1,0.3\n")
    assert detector(Frame(number=0)).ids == ("1",)


def test_a_tracker_that_saw_nothing_writes_an_empty_text(tmp_path):
    detector = read_text(tmp_path, "tracks.txt", "\n")
    assert detector.by_frame == {}
    assert detector.with_ids


def coco(**changes):
    content = {
        "images": [
            {"id": 5, "file_name": "left/0000.png", "width": 640, "height": 480},
            {"id": 6, "file_name": "frame_000001_png.rf.4f0c1e.jpg"},
        ],
        "annotations": [
            {"id": 1, "image_id": 6, "category_id": 1, "bbox": [10, 20, 20, 25], "attributes": {"track_id": 7}},
            {"id": 2, "image_id": 6, "category_id": 1, "bbox": [50, 60, 20.5, 12], "score": 0.5, "track_id": "b"},
        ],
    }
    return json.dumps({**content, **changes})


def test_coco_boxes_belong_to_the_number_in_the_file_name(tmp_path):
    detector = read_text(tmp_path, "boxes.json", coco())
    assert sorted(detector.by_frame) == [1]
    found = detector(Frame(number=1))
    assert found.boxes_px.tolist() == [[10, 20, 30, 45], [50, 60, 70.5, 72]]
    assert found.scores.tolist() == [1.0, 0.5]
    assert found.ids == ("7", "b")


def test_coco_groups_are_left_out_and_told(tmp_path):
    group = {"image_id": 5, "bbox": [0, 0, 90, 90], "iscrowd": 1}
    with pytest.warns(PomonaWarning, match="left out 1 groups"):
        detector = read_text(tmp_path, "boxes.json", coco(annotations=[group]))
    assert detector.by_frame == {}


def test_coco_results_are_numbered_by_image_id(tmp_path):
    results = [{"image_id": 1, "category_id": 1, "bbox": [10, 20, 20, 25], "score": 0.25}]
    found = read_text(tmp_path, "results.json", json.dumps(results))(Frame(number=1))
    assert found.boxes_px.tolist() == [[10, 20, 30, 45]]
    assert found.scores.tolist() == [0.25]
    assert found.ids is None


IMAGE = {"id": 5, "file_name": "0000.png"}
BOX = {"image_id": 5, "bbox": [1, 2, 3, 4]}


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("3,1,10,20,20,25,1", ["line 1", "frame: found 3", "1 to 2", "from 1"]),
        ("0,1,10,20,20,25,1", ["line 1", "frame: found 0"]),
        ("1,1,10,20,20,25\n1,2,10,20", ["line 2", "found 4 cells"]),
        ("1,1,10,20,20,25\n1,2,10,20,0,5", ["line 2", "w: found 0", "above 0"]),
        ("1,1,10,20,20,25\n\n1,2,1O,20,5,5", ["line 3", "x: found '1O'"]),
        ("1,1,10,20,20,25,90", ["line 1", "score: found 90", "0 to 1"]),
        ("1,1,10,20,20,25\n1,1,10,20,20,25", ["line 1 and line 2", "'1' twice in frame 0"]),
        ("1,1,10,20,20,25\n1,-1,10,20,20,25", ["line 2", "id: found none"]),
        ("1,1,900,20,20,25", ["line 1", "900,20,920,45 is outside the picture of 640x480"]),
        ('{"images": [}', ["line 1", "not JSON", "COCO"]),
        ('{"boxes": []}', ["images: found none", "COCO"]),
        ('{"images": [], "annotations": 3}', ["annotations: found int"]),
        (coco(images=[{"id": 1}]), ["images[0]", "file_name: missing"]),
        (coco(images=[{"id": [], "file_name": "0.png"}]), ["images[0]", "id: found []"]),
        (coco(images=[{**IMAGE, "file_name": "left.png"}]), ["images[0]", "'left.png'", "a frame number at its end"]),
        (coco(images=[{**IMAGE, "width": 1280, "height": 720}]), ["images[0]", "1280x720", "640x480"]),
        (coco(images=[IMAGE, {"id": 8, "file_name": "right/0000.png"}]), ["images[1]", "frame 0", "image 5"]),
        (coco(annotations=[BOX, {**BOX, "image_id": 9}]), ["annotations[1]", "image_id: found 9"]),
        (coco(annotations=[{"image_id": 5}]), ["annotations[0]", "bbox: missing"]),
        (coco(annotations=[{**BOX, "bbox": [1, 2, 3]}]), ["annotations[0]", "bbox: found [1, 2, 3]"]),
        (coco(annotations=[{**BOX, "bbox": [1, 2, None, 4]}]), ["annotations[0]", "bbox: found None"]),
        (coco(annotations=[{**BOX, "bbox": [1, 2, 3, -4]}]), ["annotations[0]", "3x-4 pixels"]),
        (coco(annotations=[{**BOX, "score": 7}]), ["annotations[0]", "score: found 7"]),
        (coco(images=[{**IMAGE, "file_name": "44.png"}], annotations=[BOX]), ["annotations[0]", "frame: found 44"]),
        ('[{"image_id": "x", "bbox": [1, 2, 3, 4]}]', ["[0]", "image_id: found 'x'"]),
        ("[7]", ["[0]", "image_id: missing", "int"]),
    ],
)
def test_a_wrong_file_is_told_by_its_place(tmp_path, text, parts):
    with pytest.raises(PomonaError) as caught:
        read_text(tmp_path, "boxes", text)
    line = str(caught.value)
    assert str(tmp_path / "boxes") in line
    assert "\n" not in line
    for part in parts:
        assert part in line, line


def test_no_file_and_a_folder_are_told(tmp_path):
    with pytest.raises(PomonaError, match="not found, expected boxes"):
        open_detections(tmp_path / "none.csv", CAMERA, (0,))
    with pytest.raises(PomonaError, match="no pictures found, expected instance masks"):
        open_detections(tmp_path, CAMERA, (0,))
    with pytest.raises(PomonaError, match=r"found a model, expected boxes: .*; a model goes with --model"):
        open_detections(tmp_path / "apples.onnx", CAMERA, (0,))


@dataclass
class StandIn:
    """The attributes of `supervision.Detections` that are read and written, which is not installed here (360 MB)."""

    xyxy: np.ndarray
    confidence: np.ndarray | None = None
    class_id: np.ndarray | None = None
    tracker_id: np.ndarray | None = None
    data: dict = field(default_factory=dict)


def test_supervision_takes_and_gives_back(monkeypatch):
    stand_in = types.ModuleType("supervision")
    stand_in.Detections = StandIn
    monkeypatch.setitem(sys.modules, "supervision", stand_in)
    found = Detections([[10, 20, 30, 45], [50, 60, 70.5, 80]], [0.5, 0.25], ids=("12", "7"))
    given = to_supervision(found)
    assert given.xyxy.tolist() == found.boxes_px.tolist()
    assert given.xyxy.dtype == np.float32
    assert given.class_id.tolist() == [0, 0]
    assert given.tracker_id.tolist() == [12, 7]
    back = from_supervision(given)
    assert back.boxes_px.tolist() == found.boxes_px.tolist()
    assert back.scores.tolist() == [0.5, 0.25]
    assert back.ids == found.ids
    named = to_supervision(Detections(found.boxes_px, found.scores, ids=("a", "7")))
    assert named.tracker_id is None
    assert from_supervision(named).ids == ("a", "7")
    assert to_supervision(Detections.none()).tracker_id is None


def test_supervision_gives_classes_and_tracks_of_its_own():
    boxes_px = np.array([[10, 20, 30, 45], [50, 60, 70, 80]], np.float32)
    given = StandIn(boxes_px, class_id=np.array([0, 3]), tracker_id=np.array([4, 9]))
    kept = from_supervision(given, classes=(3,))
    assert kept.boxes_px.tolist() == [[50, 60, 70, 80]]
    assert kept.scores.tolist() == [1.0]
    assert kept.ids == ("9",)
    with pytest.raises(PomonaError, match="class_id: found None"):
        from_supervision(StandIn(boxes_px), classes=(3,))


def test_without_supervision_it_is_asked_for(monkeypatch):
    monkeypatch.setitem(sys.modules, "supervision", None)
    with pytest.raises(PomonaError, match="pip install supervision"):
        to_supervision(Detections.none())
