"""`pomona detect` with the shipped detector, on photographs of rows that it was not trained on."""

import csv
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

import onnx_maker
from pomona.detect import Detections
from pomona.detect.accuracy import Found, judged
from pomona.detect.drawn_boxes import draw_boxes
from pomona.detect.onnx import OnnxDetector
from pomona.detect.picture_file import read_picture
from pomona.detect.shipped import EXACT, SHIPPED, model_named
from pomona.detect.training.labels import Labelled

PICTURES = Path(__file__).parents[1] / "testdata" / "pictures"
NAMES = sorted(path.name for path in PICTURES.glob("*.jpg"))


def boxes_in(path):
    boxes = {name: [] for name in NAMES}
    with path.open(encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            boxes[line["image"]].append([float(value) for value in list(line.values())[1:]])
    return {name: np.array(rows).reshape(len(rows), len(rows[0]) if rows else 5) for name, rows in boxes.items()}


def accuracy(path, names):
    """Precision and recall of a table of boxes in some pictures."""
    truth, found = boxes_in(PICTURES / "boxes.csv"), boxes_in(path)
    pairs = []
    for name in names:
        detections = Detections(found[name][:, :4], found[name][:, 4])
        known = Labelled(PICTURES / name, truth[name].astype(np.float32), np.ones(len(truth[name]), np.float32))
        pairs.append(Found(detections, known.boxes_px, known.ignored_px, known.smallest_px))
    return judged(pairs).above(0.0)


@pytest.mark.parametrize("model", [SHIPPED, EXACT])
def test_the_shipped_detector_finds_fruits_in_photographs(pomona, tmp_path, model):
    code, out, _ = pomona("detect", PICTURES, "-o", tmp_path / "boxes.csv", "--model", model)
    assert code == 0
    assert [line.split(":")[0] for line in out.splitlines()] == NAMES
    assert (tmp_path / "boxes.csv").read_text().splitlines()[0] == "image,xmin,ymin,xmax,ymax,score"
    assert accuracy(tmp_path / "boxes.csv", NAMES)[1] >= 0.7
    # In the other picture a row behind is full of fruits that have no boxes.
    assert accuracy(tmp_path / "boxes.csv", [name for name in NAMES if "apple_81" in name])[0] >= 0.8


def test_without_a_model_it_is_the_shipped_one_and_twice_the_same(pomona, tmp_path):
    for name, more in (("one.csv", ()), ("two.csv", ("--model", SHIPPED))):
        assert pomona("detect", *(PICTURES / each for each in NAMES), "-o", tmp_path / name, *more)[0] == 0
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "two.csv").read_bytes()


def test_a_least_score_leaves_the_better_boxes(pomona, tmp_path):
    pomona("detect", PICTURES, "-o", tmp_path / "few.csv", "--min-score", 0.8)
    pomona("detect", PICTURES, "-o", tmp_path / "many.csv", "--min-score", 0.1)
    few, many = ((tmp_path / name).read_text().splitlines()[1:] for name in ("few.csv", "many.csv"))
    assert 0 < len(few) < len(many)
    assert set(few) < set(many)
    assert all(float(line.split(",")[-1]) >= 0.8 for line in few)


def test_pictures_are_looked_at_twice_unless_told_otherwise(pomona, tmp_path):
    picture = read_picture(PICTURES / NAMES[0])
    for augment, arguments in ((True, ()), (True, ("--augment",)), (False, ("--no-augment",))):
        assert pomona("detect", PICTURES / NAMES[0], "-o", tmp_path / "boxes.csv", *arguments)[0] == 0
        detector = OnnxDetector.open(model_named(SHIPPED), augment=augment)
        assert detector.configuration["augment"] == augment
        assert ("looks twice" in detector.description) == augment
        found = detector.detect(picture)
        told = boxes_in(tmp_path / "boxes.csv")[NAMES[0]]
        np.testing.assert_allclose(told, np.column_stack([found.boxes_px, found.scores]), atol=0.006)
    # A network of one size sees no more of an enlarged picture.
    model = onnx_maker.yolov8(tmp_path / "apples.onnx", 320, 256)
    assert pomona("detect", PICTURES / NAMES[0], "-o", tmp_path / "boxes.csv", "--model", model)[0] == 0
    code, out, told = pomona("detect", PICTURES / NAMES[0], "-o", tmp_path / "b.csv", "--model", model, "--augment")
    assert (code, out) == (2, "")
    assert told == (
        f"pomona: {model}: augment: found yolov8 with an input of 320x256, "
        "expected a network that sees pictures in their own size\n"
    )
    assert not (tmp_path / "b.csv").exists()


@pytest.mark.parametrize("shape", [(1, 1), (31, 700), (2000, 3000)])
def test_two_looks_at_pictures_of_any_size(shape):
    # A photograph, as large as asked: tiny, thin, and so large that it is shrunk and its second look not.
    picture = cv2.resize(read_picture(PICTURES / NAMES[0]), shape[::-1], interpolation=cv2.INTER_AREA)
    found = OnnxDetector.open(model_named(SHIPPED), augment=True).detect(picture)
    assert (found.boxes_px[:, 2:] <= shape[::-1]).all()
    assert len(found) > 0 or shape != (2000, 3000)


def test_a_name_that_is_not_utf_8_is_one_line(pomona, tmp_path):
    picture = tmp_path / os.fsdecode(b"caf\xe9.jpg")
    shutil.copy(PICTURES / NAMES[0], picture)
    code, out, told = pomona("detect", picture, "-o", tmp_path / "boxes.csv")
    assert (code, out) == (2, "")
    assert told.splitlines() == [
        f"pomona: {tmp_path}/caf\\udce9.jpg: found a name that is not UTF-8, expected one that can be in a table"
    ]
    assert not (tmp_path / "boxes.csv").exists()


def test_boxes_are_drawn_and_json_counts_them(pomona, tmp_path):
    code, out, _ = pomona("detect", PICTURES, "-o", tmp_path / "b.csv", "--plot", tmp_path / "drawn", "--json")
    assert code == 0
    counts = json.loads(out)["n_boxes"]
    assert counts == {name: len(rows) for name, rows in boxes_in(tmp_path / "b.csv").items()}
    for name in NAMES:
        drawn, picture = read_picture(tmp_path / "drawn" / f"{name}.boxes.png"), read_picture(PICTURES / name)
        assert drawn.shape[:2] == (2 * picture.shape[0], 2 * picture.shape[1])  # for scores to be read
        changed = (drawn != cv2.resize(picture, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)).any(axis=2)
        assert 0 < changed.mean() < 0.5


def test_every_score_is_drawn_whole(tmp_path):
    corners = [(20, 0, 60, 30), (300, 200, 340, 240), (980, 500, 1000, 530), (5, 700, 60, 750), (400, 5, 440, 50)]
    found = Detections(np.array(corners, np.float32), np.full(len(corners), 0.87, np.float32))
    draw_boxes(tmp_path / "drawn.png", np.full((800, 1000, 3), 255, np.uint8), found)
    letters = (read_picture(tmp_path / "drawn.png").max(axis=2) < 100).astype(np.uint8)
    _, _, blobs, _ = cv2.connectedComponentsWithStats(cv2.dilate(letters, np.ones((3, 15), np.uint8)))
    inside = [row for row in blobs[1:].tolist() if row[4] > 100]
    assert len(inside) == len(corners)
    assert np.ptp([(row[2], row[3]) for row in inside], axis=0).max() <= 7  # at an edge no letter is dilated beyond it


def test_a_drawn_picture_gives_its_place_to_the_next_and_a_photograph_of_its_name_does_not(pomona, tmp_path):
    drawn = tmp_path / "drawn"
    command = ("detect", PICTURES / NAMES[0], "-o", tmp_path / "b.csv", "--plot", drawn)
    assert pomona(*command)[0] == 0
    first = (drawn / f"{NAMES[0]}.boxes.png").read_bytes()
    assert pomona(*command)[0] == 0
    assert (drawn / f"{NAMES[0]}.boxes.png").read_bytes() == first
    photograph = cv2.imencode(".png", read_picture(PICTURES / NAMES[1]))[1].tobytes()
    (drawn / f"{NAMES[0]}.boxes.png").write_bytes(photograph)
    code, _, told = pomona(*command)
    assert code == 2
    assert told == (
        f"pomona: {drawn}: is there already and is not a folder of drawn boxes: take another name, or --force to "
        "replace it\n"
    )
    assert (drawn / f"{NAMES[0]}.boxes.png").read_bytes() == photograph
    assert pomona(*command, "--force")[0] == 0


def test_a_picture_that_cannot_be_read_is_skipped_and_told(pomona, tmp_path):
    folder = tmp_path / "pictures"
    folder.mkdir()
    shutil.copy(PICTURES / NAMES[0], folder / "b.jpg")
    whole = (PICTURES / NAMES[1]).read_bytes()
    (folder / "a.jpg").write_bytes(whole[: len(whole) // 2])
    (folder / "c.png").write_bytes(b"no picture")
    code, out, told = pomona("detect", folder, "-o", tmp_path / "b.csv")
    assert code == 0
    assert [line.split(": ")[1] for line in out.splitlines()][1:] == ["skipped", "skipped"]
    assert told == f"pomona: warning: skipped 2 of 3 pictures, first {folder}/a.jpg: the JPEG is cut off\n"
    with (tmp_path / "b.csv").open(encoding="utf-8", newline="") as file:
        assert {line["image"] for line in csv.DictReader(file)} == {"b.jpg"}
    code, out, _ = pomona("detect", folder, "-o", tmp_path / "b.csv", "--json")
    assert code == 0
    assert json.loads(out)["skipped"].keys() == {"a.jpg", "c.png"}


def test_the_table_goes_through_a_pipe(tmp_path):
    command = [sys.executable, "-m", "pomona", "detect", str(PICTURES), "-o", "-"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[0] == "image,xmin,ymin,xmax,ymax,score"
    assert {line.split(",")[0] for line in done.stdout.splitlines()[1:]} == set(NAMES)


def test_pictures_of_odd_sizes_have_the_same_boxes():
    detector = OnnxDetector.open(model_named(EXACT))
    picture = read_picture(PICTURES / NAMES[0])
    whole = detector.detect(picture)
    # The bars that fill up 447x441 are no fruit; a fruit far from the cut edges is the same.
    cut = detector.detect(picture[:441, :447])
    inside = whole.boxes_px[(whole.boxes_px[:, 2:] < 380).all(axis=1)]
    assert len(inside) > 0
    for box in inside:
        assert np.abs(cut.boxes_px - box).max(axis=1).min() < 1.0
    assert (cut.boxes_px[:, 2] <= 447).all()
    assert (cut.boxes_px[:, 3] <= 441).all()


def test_a_picture_smaller_than_a_cell_and_a_very_large_one():
    detector = OnnxDetector.open(model_named(SHIPPED))
    assert len(detector.detect(np.zeros((1, 1, 3), np.uint8))) == 0
    assert len(detector.detect(np.full((2000, 3000, 3), 128, np.uint8))) == 0


@pytest.mark.parametrize(
    ("make", "arguments", "line"),
    [
        (None, ["none.jpg"], "none.jpg: not found, expected a picture"),
        (("bad.png", b"no picture"), ["bad.png"], "bad.png: not a picture, or a corrupt one"),
        (("empty/x.txt", b""), ["empty"], "empty: found no pictures, expected .png, .jpg, .jpeg"),
        (("bad.onnx", b"no model"), [PICTURES, "--model", "bad.onnx"], "bad.onnx: not a model that ONNX Runtime can"),
        (None, [PICTURES, "--model", "none.onnx"], "none.onnx: not found, expected an ONNX model"),
    ],
)
def test_wrong_input_is_one_line(pomona, tmp_path, monkeypatch, make, arguments, line):
    monkeypatch.chdir(tmp_path)
    if make:
        (tmp_path / make[0]).parent.mkdir(exist_ok=True)
        (tmp_path / make[0]).write_bytes(make[1])
    code, out, err = pomona("detect", *arguments, "-o", "b.csv")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert line in err
    assert not (tmp_path / "b.csv").exists()


def test_no_input_is_destroyed(pomona, tmp_path):
    folder = tmp_path / "pictures"
    shutil.copytree(PICTURES, folder)
    before = (folder / NAMES[0]).read_bytes()
    code, _, err = pomona("detect", folder, "-o", folder / NAMES[0], "--force")
    assert (code, "found suffix '.jpg', expected .csv" in err) == (2, True)
    table = folder / "no_table.csv"
    shutil.copy(folder / NAMES[0], table)
    assert pomona("detect", table, "-o", table, "--force")[0] == 2
    assert table.read_bytes() == before
    code, _, err = pomona("detect", folder, "-o", tmp_path / "b.csv", "--plot", folder, "--force")
    assert code == 2
    assert "expected another place to write" in err
    assert (folder / NAMES[0]).read_bytes() == before
    other = tmp_path / "other"
    shutil.copytree(PICTURES, other)
    assert pomona("detect", folder, other / NAMES[0], "-o", tmp_path / "b.csv")[0] == 2  # two of one name


@pytest.mark.parametrize(("change", "told"), [("grey", "no colour"), ("turned", "red and blue exchanged"), ("", None)])
def test_colours_that_are_amiss_are_told(pomona, tmp_path, change, told):
    folder = tmp_path / "pictures"
    folder.mkdir()
    for name in NAMES:
        picture = cv2.imread(str(PICTURES / name))
        grey = np.repeat(picture.mean(axis=2, keepdims=True).astype(np.uint8), 3, axis=2)
        given = {"grey": grey, "turned": picture[:, :, ::-1]}.get(change, picture)
        assert cv2.imwrite(str(folder / name), given)
    code, _, err = pomona("detect", folder, "-o", tmp_path / "boxes.csv")
    assert code == 0
    assert (f"2 pictures have {told}, and the detector that is inside finds few fruits there" in err) == bool(told)
    assert ("the detector that is inside" in err) == bool(told)


def test_what_is_no_picture_in_a_folder_ends_nothing_and_one_given_twice_is_one(pomona, tmp_path):
    folder = tmp_path / "pictures"
    shutil.copytree(PICTURES, folder)
    (folder / "more.png").mkdir()
    (folder / "gone.png").symlink_to(tmp_path / "nowhere.png")
    code, out, err = pomona("detect", folder, folder / NAMES[0], "-o", tmp_path / "boxes.csv")
    assert code == 0
    assert "gone.png: skipped" in out
    assert f"skipped 1 of {len(NAMES) + 1} pictures" in err
