import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from depth_scene import CAMERA, Sphere, box_of
from pomona.outline import ROUNDNESS, outline_of_box


@given(
    x=st.floats(-0.3, 0.3),
    y=st.floats(-0.2, 0.2),
    depth_m=st.floats(0.8, 3.0),
    diameter_m=st.floats(0.03, 0.15),
)
def test_outline_of_a_sphere_is_exact_off_the_axis(x, y, depth_m, diameter_m):
    sphere = Sphere((x * depth_m, y * depth_m, depth_m), diameter_m)
    outline = outline_of_box(box_of(sphere), CAMERA)
    assert outline.hidden_axis is None
    assert outline.whole_axes == 2
    np.testing.assert_allclose(outline.centre, [x, y], atol=1e-6)
    assert outline.radius == pytest.approx(diameter_m / 2 / depth_m, rel=1e-5)


def test_a_wide_angle_box_is_not_elongated():
    # At 45 degrees off the axis the outline of a sphere is an ellipse, 1.4 times as long as wide.
    wide = CAMERA.__class__(width=2000, height=480, fx=600.0, fy=600.0, cx=1000.0, cy=240.0)
    sphere = Sphere((1.0, 0.0, 1.0), 0.08)
    box = box_of(sphere, wide)
    assert (box[2] - box[0]) / (box[3] - box[1]) > 1.3
    outline = outline_of_box(box, wide)
    assert outline.hidden_axis is None
    assert outline.radius == pytest.approx(0.04, rel=1e-5)


def test_sigma_follows_the_edges():
    outline = outline_of_box(np.array([300.0, 220.0, 340.0, 260.0]), CAMERA)
    # One pixel on each edge: the middle of two edges, and half the mean of two sides.
    np.testing.assert_allclose(outline.centre_sigma, 1 / 600 / np.sqrt(2))
    assert outline.radius_sigma == pytest.approx(1 / 600 / 2)


def test_an_elongated_box_is_partly_hidden_along_its_short_side():
    outline = outline_of_box(np.array([310.0, 200.0, 330.0, 240.0]), CAMERA)
    assert outline.hidden_axis == 0
    whole = outline_of_box(np.array([300.0, 200.0, 340.0, 240.0]), CAMERA)
    assert outline.radius == pytest.approx(whole.radius, rel=1e-3)
    assert outline.slack == pytest.approx(10 / 600, rel=1e-2)


def test_a_few_pixels_are_round_whatever_rounding_does():
    assert outline_of_box(np.array([310.0, 200.0, 313.0, 203.6]), CAMERA).hidden_axis is None


@pytest.mark.parametrize("edge", range(4))
def test_a_covered_edge_leaves_the_place_to_the_opposite_one(edge):
    sphere = Sphere((0.1, -0.1, 1.2), 0.08)
    box, covered = box_of(sphere), [False] * 4
    shrunk = box.copy()
    shrunk[edge] += 14 if edge < 2 else -14
    covered[edge] = True
    outline = outline_of_box(shrunk, CAMERA, tuple(covered))
    np.testing.assert_allclose(outline.centre * 1.2, [0.1, -0.1], atol=1e-4)
    assert outline.radius * 1.2 == pytest.approx(0.04, rel=1e-3)
    assert outline.whole_axes == 1


def test_a_round_box_counts_as_it_is_whatever_covers_it():
    box = np.array([300.0, 220.0, 340.0, 260.0])
    free, covered = outline_of_box(box, CAMERA), outline_of_box(box, CAMERA, (True, False, True, True))
    np.testing.assert_array_equal(covered.centre, free.centre)
    assert covered.radius == pytest.approx(free.radius)
    assert covered.radius_sigma > free.radius_sigma


def test_the_edge_of_the_picture_is_no_edge_of_the_fruit():
    sphere = Sphere((0.62, 0.0, 1.2), 0.08)  # its right third is outside
    box = box_of(sphere)
    assert box[2] > CAMERA.width
    cut = np.minimum(box, [640, 480, 640, 480])
    outline = outline_of_box(cut, CAMERA)
    np.testing.assert_allclose(outline.centre * 1.2, [0.62, 0.0], atol=1e-4)
    assert outline.radius * 1.2 == pytest.approx(0.04, rel=1e-3)


@pytest.mark.parametrize(
    "box",
    [
        (600.0, 440.0, 640.0, 480.0),  # in the corner
        (630.0, 200.0, 640.0, 240.0),  # a quarter of it in the picture
        (0.0, 200.0, 640.0, 240.0),  # both sides
    ],
)
def test_a_box_that_the_picture_leaves_open_has_no_outline(box):
    assert outline_of_box(np.array(box), CAMERA) is None


def test_whole_fruits_of_the_captures_are_round(shared_data):
    import csv

    with (shared_data / "kinect_apples" / "114012_boxes.csv").open() as file:
        rows = list(csv.DictReader(file))
    sides = [(float(row["xmax"]) - float(row["xmin"]), float(row["ymax"]) - float(row["ymin"])) for row in rows]
    ratios = np.array([max(side) / min(side) for side in sides])
    assert np.mean(ratios < ROUNDNESS) > 0.6
