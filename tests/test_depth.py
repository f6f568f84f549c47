import csv

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from depth_scene import CAMERA, Sphere, box_of, picture
from pomona.errors import PomonaError
from pomona.survey.depth import Refusal, lift

APPLE = Sphere((0.1, -0.05, 1.3), 0.075)


def lift_one(depth_m, box, camera=CAMERA):
    return lift(depth_m, np.asarray(box, float)[None], camera)


def assert_found(lifted, sphere, within_mm=1.0, diameter_within_mm=1.0):
    assert len(lifted) == 1
    np.testing.assert_allclose(lifted.centres_in_camera[0], sphere.centre, atol=within_mm / 1000)
    assert lifted.diameters_m[0] == pytest.approx(sphere.diameter_m, abs=diameter_within_mm / 1000)


@settings(max_examples=40, deadline=None)
@given(
    x=st.floats(-0.35, 0.35),
    y=st.floats(-0.25, 0.25),
    depth_m=st.floats(0.6, 2.5),
    diameter_m=st.floats(0.04, 0.12),
)
def test_a_sphere_is_found_where_it_is(x, y, depth_m, diameter_m):
    sphere = Sphere((x * depth_m, y * depth_m, depth_m), diameter_m)
    assert_found(lift_one(picture([sphere]), box_of(sphere)), sphere, 0.5, 0.2)


def test_depth_in_millimetre_steps_costs_less_than_a_millimetre():
    depth_m = (np.round(picture([APPLE]) * 1000) / 1000).astype(np.float32)
    assert_found(lift_one(depth_m, box_of(APPLE)), APPLE)


def test_noise_averages_out():
    rng = np.random.default_rng(3)
    depth_m = picture([APPLE])
    noisy = (depth_m + 0.004 * rng.normal(size=depth_m.shape)).astype(np.float32)
    assert_found(lift_one(noisy, box_of(APPLE)), APPLE)


def test_the_row_behind_does_not_pull():
    # A second row 60 cm behind shows through all gaps around the apple, and its apples inside the box.
    behind = [Sphere((0.1 + dx, -0.05 + dy, 1.9), 0.08) for dx in (-0.05, 0.04) for dy in (-0.05, 0.05)]
    assert_found(lift_one(picture([APPLE, *behind], wall_m=2.0), box_of(APPLE)), APPLE)


def test_the_row_behind_does_not_win_where_most_of_the_depth_is_missing():
    depth_m = picture([APPLE], wall_m=2.0)
    on_apple = depth_m < 1.5
    rng = np.random.default_rng(1)
    depth_m[on_apple & (rng.random(depth_m.shape) < 0.6)] = 0.0
    assert_found(lift_one(depth_m, box_of(APPLE)), APPLE)


@pytest.mark.parametrize("share", [0.3, 0.45, 0.6])
def test_a_leaf_in_front_does_not_win(share):
    box = box_of(APPLE)
    depth_m = picture([APPLE])
    x0, y0, x1, y1 = (round(edge) for edge in box)
    depth_m[y0 : y0 + round(share * (y1 - y0)), x0:x1] = 1.15
    assert_found(lift_one(depth_m, box), APPLE)


def test_a_leaf_across_the_middle_does_not_win():
    box = box_of(APPLE)
    depth_m = picture([APPLE])
    x0, y0, x1, y1 = (round(edge) for edge in box)
    depth_m[y0 + 10 : y1 - 10, x0 - 20 : x1 + 20] = 1.2
    assert_found(lift_one(depth_m, box), APPLE)


def test_a_fruit_half_hidden_by_a_leaf_is_found_whole():
    # The box holds the visible part only, as a detector draws it: its left half is behind a leaf.
    box = box_of(APPLE)
    middle = round((box[0] + box[2]) / 2)
    depth_m = picture([APPLE])
    depth_m[:, :middle] = 1.15
    visible = np.array([middle, box[1], box[2], box[3]])
    assert_found(lift_one(depth_m, visible), APPLE, 2.0, 1.0)


def test_a_fruit_half_hidden_by_what_has_no_depth_is_found_by_its_shape():
    box = box_of(APPLE)
    middle = round((box[0] + box[2]) / 2)
    depth_m = picture([APPLE])
    depth_m[:, :middle] = 0.0
    lifted = lift_one(depth_m, [middle, box[1], box[2], box[3]])
    assert_found(lifted, APPLE, 10.0, 1.0)
    # What is not known shows in the covariance: across the ray, along x.
    assert np.sqrt(lifted.covariances[0, 0, 0]) > 1.5 * np.sqrt(lifted.covariances[0, 1, 1])
    error = lifted.centres_in_camera[0] - APPLE.centre
    assert error @ np.linalg.solve(lifted.covariances[0], error) < 12  # 99.2 % of chi^2 with 3 degrees


def test_a_fruit_cut_by_the_edge_of_the_picture_is_found_whole():
    sphere = Sphere((-0.62, 0.0, 1.2), 0.08)
    box = box_of(sphere)
    assert box[0] < 0
    assert_found(lift_one(picture([sphere]), box), sphere, 2.0, 1.0)


def test_boxes_that_cannot_be_lifted_are_counted():
    depth_m = picture([APPLE])
    depth_m[200:260, 100:160] = 0.0
    boxes = np.array([box_of(APPLE), (105, 205, 150, 250), (600, 440, 640, 480)], float)
    lifted = lift(depth_m, boxes, CAMERA)
    assert lifted.rows.tolist() == [0]
    assert sorted(lifted.refused.values()) == [Refusal.CUT, Refusal.NO_DEPTH]


def test_no_boxes_give_no_fruits():
    lifted = lift(picture([]), np.empty((0, 4)), CAMERA)
    assert lifted.centres_in_camera.shape == (0, 3)
    assert lifted.covariances.shape == (0, 3, 3)


def test_the_covariance_is_long_along_the_ray_and_positive():
    lifted = lift_one(picture([APPLE]), box_of(APPLE))
    sizes, axes = np.linalg.eigh(lifted.covariances[0])
    assert sizes[0] > 0
    ray = np.array(APPLE.centre) / np.linalg.norm(APPLE.centre)
    assert abs(axes[:, 2] @ ray) > 0.95
    assert sizes[2] > 1.5 * sizes[1]


def test_the_covariance_says_how_far_boxes_and_noise_move_the_centre():
    rng = np.random.default_rng(8)
    clean, box = picture([APPLE]), box_of(APPLE)
    distances2, sizes = [], []
    for _ in range(200):
        noisy = (clean + 0.004 * rng.normal(size=clean.shape)).astype(np.float32)
        lifted = lift_one(noisy, box + rng.normal(size=4))
        error = lifted.centres_in_camera[0] - APPLE.centre
        distances2.append(error @ np.linalg.solve(lifted.covariances[0], error))
        sizes.append((lifted.diameters_m[0] - APPLE.diameter_m) / lifted.diameter_sigmas_m[0])
    # It also holds what a sphere without texture does not show, so it is larger than this scatter, but not by much.
    assert 0.8 < np.mean(distances2) < 3.5
    assert 0.2 < np.std(sizes) < 1.1


def test_a_fruit_twice_as_far_with_the_same_outline_is_twice_as_large():
    near, far = Sphere((0.05, 0.02, 1.0), 0.06), Sphere((0.10, 0.04, 2.0), 0.12)
    np.testing.assert_allclose(box_of(near), box_of(far), atol=1e-9)
    ratio = lift_one(picture([far]), box_of(far)).diameters_m / lift_one(picture([near]), box_of(near)).diameters_m
    assert ratio[0] == pytest.approx(2.0, rel=1e-3)


def test_whole_fruits_of_the_captures_are_round(shared_data):
    # Longer than 1.15 times their width they count as partly hidden.
    with (shared_data / "kinect_apples" / "114012_boxes.csv").open() as file:
        rows = list(csv.DictReader(file))
    sides = [(float(row["xmax"]) - float(row["xmin"]), float(row["ymax"]) - float(row["ymin"])) for row in rows]
    assert np.mean([max(side) / min(side) < 1.15 for side in sides]) > 0.6


def test_a_depth_picture_of_another_size_is_refused():
    with pytest.raises(PomonaError, match="expected 640 x 480"):
        lift(picture([])[:200], np.empty((0, 4)), CAMERA)
