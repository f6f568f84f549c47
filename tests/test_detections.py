import pytest

from depth_scene import CAMERA
from pomona import PomonaError
from pomona.detect import Detections
from pomona.detect.from_file import FileDetector
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
        ([HEADER, "0,10,20,30,45,1,a", "0,11,20,30,45,1,a"], ["lines 2 and 3", "'a' twice in frame 0"]),
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
    with pytest.raises(PomonaError, match="not a CSV text"):
        FileDetector.read(tmp_path / "detections.csv", CAMERA, (0,))


def test_detections_are_checked_where_they_are_made():
    with pytest.raises(PomonaError, match="xmin >= xmax"):
        Detections([[10, 10, 10, 20]], [1.0])
    with pytest.raises(PomonaError, match="shapes"):
        Detections([[10, 10, 20, 20]], [1.0, 0.5])
    with pytest.raises(PomonaError, match="each once"):
        Detections([[10, 10, 20, 20], [30, 10, 40, 20]], [1.0, 0.5], ids=("a", "a"))
    assert Detections.none().boxes_px.shape == (0, 4)
