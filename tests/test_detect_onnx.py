"""Every family of detectors, by small real graphs that ONNX Runtime runs on pictures."""

import sys

import numpy as np
import pytest

import onnx_maker
from pomona import PomonaError
from pomona.detect.onnx import FAMILIES, OnnxDetector
from pomona.recording import Frame

WIDE = (160, 128)
"""Input of the networks, wide."""
BOX = (60, 48, 102, 84)
"""The red rectangle in the pictures."""

ULTRALYTICS = {
    "description": "Ultralytics YOLO11n model trained on apples.yaml",
    "author": "Ultralytics",
    "stride": "32",
    "task": "detect",
    "batch": "1",
    "imgsz": "[128, 160]",
    "names": "{0: 'apple', 1: 'pear'}",
    "args": "{'batch': 1, 'half': False, 'nms': False}",
}


def red_rectangle(width, height, box=BOX):
    picture = np.zeros((height, width, 3), np.uint8)
    picture[box[1] : box[3], box[0] : box[2], 2] = 255  # BGR
    return picture


def found_in(detector, picture):
    found = detector(Frame(0, read_left=lambda: picture))
    return [tuple(box) for box in found.boxes_px.tolist()], found.scores.round(4).tolist()


def make(kind, path, **options):
    return getattr(onnx_maker, kind)(path, *WIDE, **options)


@pytest.mark.parametrize(
    ("kind", "options", "family", "score"),
    [
        ("yolov8", {}, "yolov8", 0.9),
        ("yolov8", {"half": True}, "yolov8", 0.9),
        ("yolov8", {"double": True}, "yolov8", 0.9),
        ("yolov8", {"classes": 1}, "yolov8", 0.9),
        ("yolov5", {"classes": 1}, "yolov5", 0.72),
        ("yolov5", {"classes": 3}, "yolov5", 0.72),
        ("end_to_end", {}, "yolo-end2end", 0.9),
        ("yolox", {"decoded": False}, "yolox", 0.72),
        ("yolox", {"decoded": True}, "yolox", 0.72),
    ],
)
@pytest.mark.parametrize("size_px", [(320, 200), (120, 256), (320, 202), (320, 256)], ids=str)
def test_padded_pictures(tmp_path, kind, options, family, score, size_px):
    # Half the size in the network: 160x100 and bars above and below, 60x128 and bars left and right, 160x101, no bars.
    detector = OnnxDetector.open(make(kind, tmp_path / "model.onnx", **options))
    assert detector.signature.family == family
    boxes, scores = found_in(detector, red_rectangle(*size_px))
    assert np.allclose(boxes, [BOX], atol=2e-3 if kind == "yolox" else 1e-6)  # YOLOX: exp and log in float32
    assert scores == [score]


@pytest.mark.parametrize(
    ("kind", "options", "family", "score"),
    [
        ("rtdetr", {}, "rtdetr", 0.9),
        ("rtdetr", {"half": True}, "rtdetr", 0.9),
        ("rfdetr", {}, "rfdetr", round(1 / (1 + np.exp(-2)), 4)),
        (
            "rtdetr_ultralytics",
            {"metadata": {**ULTRALYTICS, "description": "Ultralytics rtdetr-l model trained on apples"}},
            "rtdetr-ultralytics",
            0.9,
        ),
    ],
)
@pytest.mark.parametrize("size_px", [(320, 384), (160, 128), (480, 128)], ids=str)
def test_stretched_pictures(tmp_path, kind, options, family, score, size_px):
    # A half and a third of the size, the same, a third and the same.
    detector = OnnxDetector.open(make(kind, tmp_path / "model.onnx", **options), tiles="off")
    assert detector.signature.family == family
    boxes, scores = found_in(detector, red_rectangle(*size_px))
    assert np.allclose(boxes, [BOX], atol=1e-4)  # parts of the input in float32
    assert scores == [score]


def test_a_picture_smaller_than_the_input(tmp_path):
    detector = OnnxDetector.open(make("yolov8", tmp_path / "model.onnx"))
    assert found_in(detector, red_rectangle(80, 50, (20, 11, 45, 30))) == ([(20, 11, 45, 30)], [0.9])


@pytest.mark.parametrize(
    ("kind", "options", "size_px"),
    [
        ("yolov8", {"masks": True}, (320, 200)),
        ("yolov5", {"masks": True}, (320, 200)),
        ("end_to_end", {"masks": True}, (320, 200)),
        ("rfdetr", {"masks": "masks"}, (320, 256)),
        ("rfdetr", {"masks": "4245"}, (320, 256)),  # so the first exports named it
    ],
)
def test_masks_give_tight_boxes(tmp_path, kind, options, size_px):
    # The boxes are drawn 6 to 9 px too large; the masks have cells of 4 px of the input, on whose edges the fruit ends.
    box = (64, 72, 104, 88) if kind == "rfdetr" else (64, 44, 104, 84)
    detector = OnnxDetector.open(make(kind, tmp_path / "model.onnx", **options))
    boxes, _ = found_in(detector, red_rectangle(*size_px, box))
    assert boxes == [box]


def test_nothing_is_a_result(tmp_path):
    for kind in ("yolov8", "yolov5", "end_to_end", "yolox", "rtdetr", "rfdetr"):
        detector = OnnxDetector.open(make(kind, tmp_path / "model.onnx"))
        found = detector(Frame(0, read_left=lambda: np.zeros((200, 320, 3), np.uint8)))
        assert found.boxes_px.shape == (0, 4), kind


def test_classes_are_one_fruit_unless_told_otherwise(tmp_path):
    path = make("yolov8", tmp_path / "model.onnx", double=True, metadata=ULTRALYTICS)
    picture = red_rectangle(320, 200)
    moved = (BOX[0] + 2, BOX[1], BOX[2] + 2, BOX[3])  # one pixel of the input
    assert found_in(OnnxDetector.open(path), picture) == ([BOX], [0.9])
    assert found_in(OnnxDetector.open(path, class_agnostic=False), picture) == ([BOX, moved], [0.9, 0.6])
    assert found_in(OnnxDetector.open(path, class_agnostic=False, min_score=0.7), picture) == ([BOX], [0.9])
    assert found_in(OnnxDetector.open(path, iou=0.98), picture) == ([BOX, moved], [0.9, 0.6])
    assert found_in(OnnxDetector.open(path, classes=("pear",)), picture) == ([moved], [0.6])
    assert found_in(OnnxDetector.open(path, classes=(1,)), picture) == ([moved], [0.6])
    with pytest.raises(PomonaError, match=r"model.onnx: class: found 'plum', expected apple, pear$"):
        OnnxDetector.open(path, classes=("plum",))
    with pytest.raises(PomonaError, match="class: found 2, expected apple, pear"):
        OnnxDetector.open(path, classes=(2,))


def test_a_network_of_any_size(tmp_path):
    path = make("yolov8", tmp_path / "model.onnx", dynamic=True, metadata=ULTRALYTICS)
    detector = OnnxDetector.open(path)
    assert detector.signature.size_px == WIDE  # imgsz is height, width
    assert found_in(detector, red_rectangle(320, 200)) == ([BOX], [0.9])
    # This graph has as many cells at any size, which no real one has.
    larger = OnnxDetector.open(path, size_px=(320, 256), family="yolov8")
    assert found_in(larger, red_rectangle(320, 200)) == ([BOX], [0.9])


def test_one_class_of_yolov5_is_no_chosen_box(tmp_path):
    # Rows of six numbers both: cx cy w h objectness class, and x0 y0 x1 y1 score class.
    five = OnnxDetector.open(make("yolov5", tmp_path / "five.onnx"))
    chosen = OnnxDetector.open(make("end_to_end", tmp_path / "chosen.onnx"))
    assert (five.signature.family, chosen.signature.family) == ("yolov5", "yolo-end2end")


@pytest.mark.parametrize(
    ("kind", "metadata", "family", "grounds"),
    [
        ("yolov8", ULTRALYTICS, "yolov8", "Ultralytics"),
        ("yolov8", {**ULTRALYTICS, "end2end": "False"}, "yolov8", "Ultralytics"),
        ("end_to_end", {**ULTRALYTICS, "end2end": "True"}, "yolo-end2end", "Ultralytics"),
        ("end_to_end", ULTRALYTICS, "yolo-end2end", "Ultralytics"),  # YOLOv10, before there was a key
        ("end_to_end", {**ULTRALYTICS, "names": "{0: 'apple'}"}, "yolo-end2end", "Ultralytics"),
        ("end_to_end", {**ULTRALYTICS, "args": "{'nms': True}"}, "yolo-end2end", "Ultralytics"),
        ("yolov5", {"stride": "32", "names": "['apple']"}, "yolov5", "Ultralytics"),
        ("end_to_end", {"pomona_detector": {"version": 1, "family": "yolo26"}}, "yolo-end2end", "pomona_detector"),
        ("yolov8", {}, "yolov8", "inputs and outputs"),
    ],
)
def test_metadata_is_believed(tmp_path, kind, metadata, family, grounds):
    detector = OnnxDetector.open(make(kind, tmp_path / "model.onnx", metadata=metadata))
    assert detector.signature.family == family
    assert grounds in detector.description
    assert found_in(detector, red_rectangle(320, 200)) == ([BOX], [0.72 if family == "yolov5" else 0.9])


def test_our_own_metadata_beats_the_family(tmp_path):
    own = {"version": 1, "family": "yolov8", "names": ["apple", "pear"], "preparation": {"fit": "stretch"}}
    path = make("yolov8", tmp_path / "model.onnx", metadata={**ULTRALYTICS, "task": "pose", "pomona_detector": own})
    detector = OnnxDetector.open(path, tiles="off")
    assert detector.signature.preparation.fit == "stretch"
    assert found_in(detector, red_rectangle(320, 384)) == ([BOX], [0.9])
    assert "yolov8 (YOLOv8, v9, 11, 12) by its metadata pomona_detector; input 160x128 RGB/255, stretch" in (
        detector.description
    )
    assert detector.description.endswith("fruits are of 2 classes: apple, pear")


def test_rfdetr_says_which_slots_are_things(tmp_path):
    rfdetr = {
        "schema_version": 1,
        "task": "detect",
        "outputs": {"pred_boxes": "dets", "pred_logits": "labels"},
        "means": [0.485, 0.456, 0.406],
        "stds": [0.229, 0.224, 0.225],
        "class_names": ["green", "red"],
        "class_id_to_name": {"1": "green", "3": "red"},
    }
    path = make("rfdetr", tmp_path / "model.onnx", metadata={"rfdetr_inference": rfdetr})
    detector = OnnxDetector.open(path, classes=("green",))
    assert np.allclose(found_in(detector, red_rectangle(320, 256))[0], [BOX], atol=1e-4)
    # Without the metadata the last slot stands for nothing; with it, slot 3 is a thing, and the strongest.
    both = OnnxDetector.open(path)(Frame(0, read_left=lambda: red_rectangle(320, 256)))
    assert len(both) == 2
    assert OnnxDetector.open(path).description.endswith("fruits are of 2 classes: green, red")
    assert "rfdetr_inference" in OnnxDetector.open(path).description
    with pytest.raises(PomonaError, match="class: found 2, expected green, red"):
        OnnxDetector.open(path, classes=(2,))


def test_the_user_knows_best(tmp_path):
    path = make("yolov8", tmp_path / "model.onnx", metadata={**ULTRALYTICS, "description": "Ultralytics rtdetr-l"})
    detector = OnnxDetector.open(path, family="YOLO11")
    assert detector.signature.family == "yolov8"
    assert "as was said" in detector.description


def test_the_same_boxes_on_any_number_of_threads(tmp_path):
    path = make("yolov8", tmp_path / "model.onnx", double=True)
    picture = red_rectangle(321, 201, (61, 47, 102, 85))
    one, two = (OnnxDetector.open(path, threads=threads).detect(picture) for threads in (1, 2))
    assert one.boxes_px.tobytes() == two.boxes_px.tobytes()
    assert one.scores.tobytes() == two.scores.tobytes()


def test_an_unknown_signature_is_told_with_what_is_accepted(tmp_path):
    graph = onnx_maker.Graph(*WIDE)
    path = graph.write(tmp_path / "model.onnx", {"heat": graph.add("ReduceMean", graph.images, axes=[1])})
    with pytest.raises(PomonaError) as caught:
        OnnxDetector.open(path)
    line = str(caught.value)
    assert "\n" not in line
    assert "model.onnx: outputs: found heat (1, 128, 160), expected those of a family" in line
    for family, about in FAMILIES.items():
        assert f"{family} ({about.signature})" in line
    with pytest.raises(PomonaError, match=r"found heat .* expected those of yolov8: output0"):
        OnnxDetector.open(path, family="yolov8")


@pytest.mark.parametrize(
    ("metadata", "parts"),
    [
        ({**ULTRALYTICS, "task": "pose"}, ["metadata task: found 'pose'", "detect or segment"]),
        ({**ULTRALYTICS, "names": "__import__('os').getcwd()"}, ["metadata names: cannot be read"]),
        ({**ULTRALYTICS, "names": "{0: 'apple'}"}, ["outputs: found output0 (6, 420)"]),
        ({"rfdetr_inference": "{"}, ["metadata rfdetr_inference: line 1: not JSON"]),
        ({"rfdetr_inference": {"task": "keypoints"}}, ["task: found 'keypoints'"]),
        ({"pomona_detector": {"version": 2, "family": "yolov8"}}, ["version: found 2, expected 1"]),
        ({"pomona_detector": {"version": 1}}, ["metadata pomona_detector: cannot be read", "family"]),
        ({"pomona_detector": {"version": 1, "family": "yolo99"}}, ["family: found 'yolo99'", "yolov8", "deim"]),
        ({"pomona_detector": {"version": 1, "family": "yolov8", "size": 3}}, ["found size, expected version"]),
        (
            {"pomona_detector": {"version": 1, "family": "yolov8", "preparation": {"fit": "crop"}}},
            ["fit: found 'crop'", "letterbox"],
        ),
        ({"pomona_detector": {"version": 1, "family": "yolox"}}, ["found output0", "those of yolox"]),
    ],
)
def test_metadata_that_is_wrong_is_told(tmp_path, metadata, parts):
    path = make("yolov8", tmp_path / "model.onnx", metadata=metadata)
    with pytest.raises(PomonaError) as caught:
        OnnxDetector.open(path)
    line = str(caught.value)
    assert "\n" not in line
    for part in ["model.onnx", *parts]:
        assert part in line, line


def test_files_that_are_no_models_are_told(tmp_path):
    (tmp_path / "model.onnx").write_bytes(b"version https://git-lfs.github.com/spec/v1\n")
    with pytest.raises(PomonaError, match=r"^\S*model.onnx: not a model that ONNX Runtime can load: [^\n]*$"):
        OnnxDetector.open(tmp_path / "model.onnx")
    with pytest.raises(PomonaError, match=r"none\.onnx: not found, expected an ONNX model"):
        OnnxDetector.open(tmp_path / "none.onnx")
    with pytest.raises(PomonaError, match=r"family: found .ssd. in the setting, expected one of pomona, rfdetr, "):
        OnnxDetector.open(make("yolov8", tmp_path / "model.onnx"), family="ssd")
    with pytest.raises(PomonaError, match="min_score: found 25, expected 0 to 1"):
        OnnxDetector.open(tmp_path / "model.onnx", min_score=25)


def test_inputs_that_are_no_picture_are_told(tmp_path):
    graph = onnx_maker.Graph(*WIDE)
    graph.inputs[0].type.tensor_type.shape.dim[0].dim_value = 4
    path = graph.write(tmp_path / "model.onnx", {"output0": graph.images})
    with pytest.raises(PomonaError, match=r"inputs: found images \[4, 3, 128, 160\] tensor\(float\), expected one pic"):
        OnnxDetector.open(path)


@pytest.mark.parametrize(
    ("picture", "found"),
    [
        (np.zeros((9, 9, 3), np.float32), "(9, 9, 3) float32"),
        (np.zeros((9, 9, 3), np.uint16), "(9, 9, 3) uint16"),
        (np.zeros((9, 9, 3), bool), "(9, 9, 3) bool"),
        (np.zeros((9, 9, 4), np.uint8), "(9, 9, 4) uint8"),
        (np.zeros((3, 9, 9), np.uint8), "(3, 9, 9) uint8"),
        (np.zeros((9, 9), np.uint8), "(9, 9) uint8"),
        (np.zeros((0, 9, 3), np.uint8), "(0, 9, 3) uint8"),
        (None, "NoneType"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_arrays_that_are_no_pictures_are_told(tmp_path, picture, found):
    detector = OnnxDetector.open(make("yolov8", tmp_path / "model.onnx"))
    with pytest.raises(PomonaError) as caught:
        detector.detect(picture)
    assert str(caught.value) == f"picture: found {found}, expected a picture, (H, W, 3) uint8 in the order BGR"


def test_a_frame_without_a_left_picture_is_told(tmp_path):
    detector = OnnxDetector.open(make("yolov8", tmp_path / "model.onnx"))
    with pytest.raises(PomonaError, match="frame 7: found no left picture"):
        detector(Frame(7))


def test_without_onnx_runtime_it_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(PomonaError, match=r"pip install onnxruntime"):
        OnnxDetector.open(make("yolov8", tmp_path / "model.onnx"))
