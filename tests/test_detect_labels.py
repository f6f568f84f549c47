"""Labels of pictures as a table, and the crops and targets that training makes of them; no torch is needed."""

import csv
import io

import cv2
import numpy as np
import pytest

from pomona import PomonaError
from pomona.detect import Detections
from pomona.detect.picture_boxes import boxes_within, read_boxes, table_of
from pomona.detect.training.cache import Sample, cached
from pomona.detect.training.labels import Labelled
from pomona.detect.training.shown_crops import SIDE_PX, PictureCrop, drawn_crop
from pomona.detect.training.targets import STRIDE, targets_of

HEADER = "image,xmin,ymin,xmax,ymax"


def labelled(path, boxes, size=(400, 500)):
    picture = np.full((*size, 3), 40, np.uint8)
    for xmin, ymin, xmax, ymax in boxes:
        picture[ymin:ymax, xmin:xmax] = (30, 30, 220)
    assert cv2.imwrite(str(path), picture)
    return Labelled(path, np.array(boxes, np.float32).reshape(-1, 4), np.full(len(boxes), np.nan, np.float32))


def table(tmp_path, *lines):
    path = tmp_path / "boxes.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_what_is_written_is_read(tmp_path):
    found = Detections(np.array([[1.25, 2, 30, 40]]), np.array([0.5]))
    path = table(tmp_path, table_of([("a, b.png", found), ("none.png", Detections.none())]).rstrip())
    boxes = read_boxes(path, ["a, b.png", "none.png"])
    assert {name: [box.corners_px for box in rows] for name, rows in boxes.items()} == {
        "a, b.png": [(1.25, 2.0, 30.0, 40.0)]
    }


def test_a_name_with_a_carriage_return_is_one_cell():
    found = Detections(np.array([[1.25, 2, 30, 40]]), np.array([0.5]))
    lines = csv.reader(io.StringIO(table_of([("a\rb.png", found)]), newline=""))
    assert [line[0] for line in lines] == ["image", "a\rb.png"]


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ([HEADER, "a.png,1,2,3"], "line 2: found 4 cells, expected 5 as in the header"),
        ([HEADER, "a.png,1,2,x,4"], "line 2: xmax: found 'x'"),
        ([HEADER, "a.png,3,2,1,4"], "line 2: found xmin 3 and xmax 1, expected xmin below"),
        ([HEADER, "a.png,1,2,nan,4"], "line 2: xmax: found 'nan'"),
        ([HEADER, "a.png,1,2,3,4", "b.png,1,2,3,4"], "line 3: image: found 'b.png', which is no picture there"),
        (["image,x,y,w,h", "a.png,1,2,3,4"], "expected a header with image, xmin, ymin, xmax, ymax"),
        ([""], "found an empty file"),
    ],
)
def test_wrong_tables_are_told_with_their_line(tmp_path, lines, told):
    with pytest.raises(PomonaError) as caught:
        read_boxes(table(tmp_path, *lines), ["a.png"])
    assert str(caught.value).startswith(str(tmp_path / "boxes.csv"))
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_boxes_are_cut_at_the_edge_and_refused_outside(tmp_path):
    path = table(tmp_path, HEADER, "a.png,-5,2,30,40", "a.png,200,2,230,40")
    boxes = read_boxes(path, ["a.png"])["a.png"]
    assert boxes_within(path, boxes, (210, 30)).tolist() == [[0, 2, 30, 30], [200, 2, 210, 30]]
    with pytest.raises(PomonaError, match=r"line 3: the box 200,2,230,40 is outside the picture of 100x50 pixels"):
        boxes_within(path, boxes, (100, 50))


def test_crops_show_the_fruits_where_their_boxes_are(tmp_path):
    samples = cached([labelled(tmp_path / "a.png", [(60, 80, 120, 150), (300, 200, 360, 270)])], tmp_path / "cache")
    seen = 0
    for number in range(40):
        crop = drawn_crop(samples * 4, np.random.default_rng([1, number]))
        assert crop.pixels.shape == (SIDE_PX, SIDE_PX, 3)
        assert (crop.boxes_px >= 0).all()
        assert (crop.boxes_px <= SIDE_PX).all()
        red = crop.pixels.astype(int).ptp(axis=2) if hasattr(np.ndarray, "ptp") else np.ptp(crop.pixels.astype(int), 2)
        for x, y in ((crop.boxes_px[:, :2] + crop.boxes_px[:, 2:]) / 2).astype(int):
            seen += 1
            assert red[min(y, SIDE_PX - 1), min(x, SIDE_PX - 1)] > np.median(red)
    assert seen > 40


def test_the_same_seed_draws_the_same_crop(tmp_path):
    samples = cached([labelled(tmp_path / "a.png", [(60, 80, 120, 150)])], tmp_path / "cache") * 4
    one, two = (drawn_crop(samples, np.random.default_rng([3, 4])) for _ in range(2))
    assert (one.pixels == two.pixels).all()
    assert (one.boxes_px == two.boxes_px).all()


def test_large_pictures_are_shrunk_with_their_boxes(tmp_path):
    (sample,) = cached([labelled(tmp_path / "a.png", [(500, 100, 600, 300)], (800, 2560))], tmp_path / "cache")
    assert sample.pixels.shape == (400, 1280, 3)
    assert sample.labelled.boxes_px.tolist() == [[250, 50, 300, 150]]


def test_targets_mark_each_fruit_once_and_leave_out_what_is_ignored():
    pixels = np.zeros((SIDE_PX, SIDE_PX, 3), np.uint8)
    boxes_px = np.array([[40, 40, 80, 88], [200, 100, 207, 107]], np.float32)
    ignored_px = np.array([[240, 240, 300, 300]], np.float32)
    made = targets_of(PictureCrop(pixels, boxes_px, np.array([0.5, np.nan], np.float32), ignored_px))
    assert np.argwhere(made.heat == 1).tolist() == [[16, 15], [25, 50]]
    assert made.punished[60:75, 60:75].max() == 0
    assert made.punished[:60].min() == 1
    # The distances to the edges lead back to the box.
    rows, columns = np.nonzero(made.weights)
    edges = made.edges_px[:, rows, columns]
    corners = np.stack([(columns + 0.5) * STRIDE - edges[0], (rows + 0.5) * STRIDE - edges[1]])
    assert {tuple(corner) for corner in corners.T.tolist()} == {(40.0, 40.0), (200.0, 100.0)}
    assert made.visible[16, 15] == 0.5


def test_a_picture_without_fruits_is_all_background():
    crop = PictureCrop(np.zeros((64, 64, 3), np.uint8), *(np.empty(shape, np.float32) for shape in ((0, 4), 0, (0, 4))))
    made = targets_of(crop)
    assert made.heat.max() == 0
    assert made.weights.max() == 0


def test_a_sample_of_labels_that_are_all_cut_away_is_no_error():
    one = Labelled(None, np.array([[0, 0, 3, 3]], np.float32), np.array([np.nan], np.float32))
    sample = Sample(np.zeros((50, 60, 3), np.uint8), one)
    for number in range(20):
        assert len(drawn_crop([sample] * 4, np.random.default_rng(number)).pixels) == SIDE_PX
