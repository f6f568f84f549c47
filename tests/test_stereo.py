"""Stereo depth at the fruits, on pairs made of spheres and on rendered ones with exact truth."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from benchmarks.recordings import in_camera, rendered_truth, true_boxes

from depth_scene import box_of
from pomona.errors import PomonaError
from pomona.recording import open_recording
from pomona.stereo import DenseStereo, StereoDepth
from pomona.survey.depth import Refusal, lift
from stereo_scene import PAIR, Leaf, apple, pair, without_baseline

APPLES = [apple(-0.15, -0.1, 1.2), apple(0.1, 0.05, 1.5), apple(0.2, -0.15, 1.0), apple(-0.05, 0.15, 1.35)]
FOCAL_BASELINE = PAIR.fx * PAIR.baseline_m


def boxes_of(spheres):
    return np.array([box_of(sphere, PAIR) for sphere in spheres])


def true_disparities(spheres):
    return FOCAL_BASELINE / np.array([sphere.centre[2] for sphere in spheres])


def test_the_disparity_of_a_fruit_is_that_of_its_centre():
    left, right, _ = pair(APPLES)
    found = StereoDepth(PAIR)(left, right, boxes_of(APPLES))
    np.testing.assert_allclose(found.disparity_px, true_disparities(APPLES), atol=0.15)
    assert (found.support > 0.8).all()


def test_fruits_are_lifted_to_where_they_are_with_covariances_that_hold():
    left, right, _ = pair(APPLES)
    boxes = boxes_of(APPLES)
    lifted = lift(StereoDepth(PAIR)(left, right, boxes), boxes, PAIR)
    assert lifted.rows.tolist() == [0, 1, 2, 3]
    errors = lifted.centres_in_camera - [sphere.centre for sphere in APPLES]
    assert np.abs(errors).max() < 0.01
    for error, covariance in zip(errors, lifted.covariances, strict=True):
        assert error @ np.linalg.solve(covariance, error) < 11.3  # 99 % of chi^2 with 3 degrees
    np.testing.assert_allclose(lifted.diameters_m, 0.075, atol=0.002)


def test_a_large_picture_is_matched_with_some_of_its_pixels():
    # 100 px wide and more: every eighth pixel of a box, every third row and column of a window.
    large = replace(PAIR, width=1280, height=960, fx=1680.0, fy=1680.0, cx=640.0, cy=480.0)
    left, right, depth_m = pair(APPLES, camera=large)
    boxes = np.array([box_of(sphere, large) for sphere in APPLES])
    found = StereoDepth(large)(left, right, boxes)
    np.testing.assert_allclose(found.disparity_px, 4 * true_disparities(APPLES), atol=0.3)
    assert (found.support > 0.8).all()
    measured = found.depth_m > 0
    assert np.median(np.abs(found.depth_m[measured] / depth_m[measured] - 1)) < 0.02
    for xmin, ymin, xmax, ymax in boxes.round().astype(int):
        assert measured[ymin:ymax, xmin:xmax].all()


def test_depth_is_measured_around_the_boxes_and_nowhere_else():
    left, right, depth_m = pair(APPLES)
    boxes = boxes_of(APPLES)
    measured = StereoDepth(PAIR)(left, right, boxes).depth_m
    asked = np.zeros(measured.shape, bool)
    for xmin, ymin, xmax, ymax in boxes:
        asked[int(ymin) - 6 : int(ymax) + 7, int(xmin) - 6 : int(xmax) + 7] = True
    assert not measured[~asked].any()
    assert np.median(np.abs(measured[asked & (measured > 0)] / depth_m[asked & (measured > 0)] - 1)) < 0.02


def test_a_leaf_in_front_does_not_win():
    # It hides the left 40 % of the second apple, and the box still holds the whole apple.
    x, y, z = APPLES[1].centre
    leaf = Leaf((x - 0.06, y - 0.06), (x - 0.0075, y + 0.06), z - 0.2)
    left, right, _ = pair(APPLES, [leaf])
    found = StereoDepth(PAIR)(left, right, boxes_of(APPLES))
    assert found.disparity_px[1] == pytest.approx(true_disparities(APPLES)[1], abs=0.4)


def test_a_fruit_that_only_the_left_camera_sees_is_placed_by_its_size_and_says_so():
    # A leaf right in front of the right camera's view of the second apple, beside the left camera's.
    x, y, z = APPLES[1].centre
    near_m = 0.7
    seen_from_right = PAIR.baseline_m + (x - PAIR.baseline_m) * near_m / z
    leaf = Leaf(
        (seen_from_right - 0.03, y * near_m / z - 0.04), (seen_from_right + 0.03, y * near_m / z + 0.04), near_m
    )
    left, right, depth_m = pair(APPLES, [leaf])
    boxes = boxes_of(APPLES)
    xmin, ymin, xmax, ymax = boxes[1].astype(int)
    assert depth_m[ymin + 2 : ymax - 2, xmin + 5 : xmax - 5].min() > 1.4
    # Three sure matches do not know a size: then nothing is known of it.
    alone = lift(StereoDepth(PAIR)(left, right, boxes), boxes, PAIR)
    assert alone.rows.tolist() == [0, 2, 3]
    assert alone.refused == {1: Refusal.UNMATCHED}
    more = [*APPLES, apple(-0.25, 0.2, 1.1, 0.085)]
    left, right, _ = pair(more, [leaf])
    lifted = lift(StereoDepth(PAIR)(left, right, boxes_of(more)), boxes_of(more), PAIR)
    assert lifted.measured.tolist() == [True, False, True, True, True]
    assert lifted.centres_in_camera[1, 2] == pytest.approx(z, rel=0.15)
    assert 0.12 < np.sqrt(lifted.covariances[1, 2, 2]) / z < 0.3


def test_pictures_without_any_contrast_match_nothing():
    flat = np.full((PAIR.height, PAIR.width, 3), 120, np.uint8)
    boxes = boxes_of(APPLES)
    found = StereoDepth(PAIR)(flat, flat, boxes)
    assert np.isnan(found.disparity_px).all()
    assert not found.depth_m.any()
    assert lift(found, boxes, PAIR).refused == dict.fromkeys(range(4), Refusal.UNMATCHED)


def test_grey_pictures_do_too():
    left, right, _ = pair(APPLES)
    greys = [cv2.cvtColor(one, cv2.COLOR_BGR2GRAY) for one in (left, right)]
    found = StereoDepth(PAIR)(*greys, boxes_of(APPLES))
    np.testing.assert_allclose(found.disparity_px, true_disparities(APPLES), atol=0.2)


def test_no_boxes_and_boxes_off_the_picture():
    left, right, _ = pair(APPLES)
    stereo = StereoDepth(PAIR)
    assert not stereo(left, right, np.empty((0, 4))).depth_m.any()
    odd = np.array([[400.0, 300.0, 450.0, 350.0], [-50.0, -50.0, -10.0, -10.0]])
    assert np.isnan(stereo(left, right, odd).disparity_px).all()


def test_the_same_pair_gives_the_same_answer():
    left, right, _ = pair(APPLES)
    one, other = (StereoDepth(PAIR)(left, right, boxes_of(APPLES)) for _ in range(2))
    np.testing.assert_array_equal(one.disparity_px, other.disparity_px)
    np.testing.assert_array_equal(one.depth_m, other.depth_m)


def test_a_camera_without_a_baseline_and_pictures_of_another_size_are_refused():
    with pytest.raises(PomonaError, match="baseline_m"):
        StereoDepth(without_baseline())
    left, right, _ = pair([])
    with pytest.raises(PomonaError, match="found 320 x 200 pixels, expected 320 x 240"):
        StereoDepth(PAIR)(left, right[:200], np.empty((0, 4)))


def test_dense_depth_is_voted_on():
    left, right, _ = pair(APPLES)
    boxes = boxes_of(APPLES)
    found = DenseStereo(PAIR)(left, right, boxes)
    assert np.mean(found.depth_m > 0) > 0.7
    lifted = lift(found, boxes, PAIR)
    np.testing.assert_allclose(lifted.centres_in_camera[:, 2], [sphere.centre[2] for sphere in APPLES], rtol=0.03)


def test_disparity_noise_lengthens_the_covariance_along_the_ray():
    _, _, depth_m = pair(APPLES)
    boxes = boxes_of(APPLES)
    exact, rough = (lift(depth_m, boxes, PAIR, disparity_sigma_px=sigma) for sigma in (None, 0.5))
    grown = rough.covariances[:, 2, 2] - exact.covariances[:, 2, 2]
    expected = [PAIR.depth_error_m(z, 0.5) for z in exact.centres_in_camera[:, 2]]
    np.testing.assert_allclose(np.sqrt(grown), expected, rtol=1e-6)
    with pytest.raises(PomonaError, match="baseline_m"):
        lift(depth_m, boxes, without_baseline(), disparity_sigma_px=0.5)


def test_rendered_fruits_come_out_with_errors_as_large_as_they_say(shared_data):
    source = shared_data / "rendered_row" / "2024-08-09"
    recording, truth = open_recording(source), rendered_truth(source)
    place_of = dict(zip(truth.ids, truth.positions, strict=True))
    named = [box for box in true_boxes(source) if box.frame < 4]
    stereo, off_px, sigmas, support = StereoDepth(recording.calibration), [], [], []
    for frame in list(recording.frames())[:4]:
        boxes = [box for box in named if box.frame == frame.number]
        found = stereo(frame.read_left(), frame.read_right(), np.array([box.box_px for box in boxes], float))
        z = np.array([in_camera(frame.session_from_camera, place_of[box.fruit])[2] for box in boxes])
        focal_baseline = recording.calibration.fx * recording.calibration.baseline_m
        off_px.extend(found.disparity_px - focal_baseline / z)
        sigmas.extend(found.disparity_sigma_px)
        support.extend(found.support)
    matched = np.array(support) > 0
    off_px, sigmas = np.array(off_px)[matched], np.array(sigmas)[matched]
    assert matched.mean() > 0.5
    assert abs(np.median(off_px)) < 0.15
    assert np.median(np.abs(off_px)) < 0.4
    assert np.mean(np.abs(off_px) > 2) < 0.12
    # The median of chi^2 with one degree is 0.455.
    assert 0.2 < np.median((off_px / sigmas) ** 2) < 0.8
