"""The rasteriser: depth and ids are exact at the pixels' centres, both eyes see the same row."""

import hashlib
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from pomona import _core
from pomona.recording.calibration import Calibration
from pomona.render.raster import RasterRenderer
from pomona.render.scene_view import Weather
from pomona.render.true_boxes import boxes_in, full_pixels
from simple_row import simple_row

WIDTH, HEIGHT = 320, 180
CAMERA = Calibration(WIDTH, HEIGHT, 208.5, 208.5, 160.0, 90.0, 0.12)
SUN = Weather(0.8, -1.2, 3.5, (1.0, 0.93, 0.82), (0.4, 0.6, 1.1), (0.9, 1.0, 1.2))
OVERCAST = replace(SUN, sun_strength=0.0, sky_colour=(1.0, 1.0, 1.0))
LOOKING = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Camera axes in the row frame of one that looks along y."""


def pose(x_m=1.0, y_m=-1.5, z_m=1.4):
    session_from_camera = np.eye(4)
    session_from_camera[:3, :3] = LOOKING
    session_from_camera[:3, 3] = x_m, y_m, z_m
    return session_from_camera


def drawn(geometry, *poses, weather=SUN, seed=3):
    return list(RasterRenderer().render(geometry, CAMERA, np.stack(poses), weather, seed))


@pytest.fixture(scope="module")
def row():
    return simple_row(4)


@pytest.fixture(scope="module")
def pair_and_right(row):
    """A pair, and what a left camera sees from where its right one is."""
    beside = pose()
    beside[:3, 3] += CAMERA.baseline_m * beside[:3, 0]
    return drawn(row, pose(), beside)


def centres_px():
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    return np.stack([x, y], axis=-1) + 0.5


def only(geometry, *, fruits=(), leaves=(), limbs=()):
    """Give a row with no other things than those of these numbers."""
    taken = {"fruits": fruits, "leaves": leaves, "limbs": limbs}
    parts = {
        name: replace(whole, **{key: values[list(taken[name])] for key, values in whole.__dict__.items()})
        for name, whole in geometry.__dict__.items()
    }
    return replace(geometry, **parts)


def test_the_right_eye_is_a_left_eye_a_baseline_aside(pair_and_right):
    pair, beside = pair_and_right
    assert np.array_equal(pair.right, beside.left)
    assert not np.array_equal(pair.left, pair.right)


def test_depth_carries_the_left_picture_onto_the_right(pair_and_right):
    """A place that the left eye sees at a depth is where the right eye sees it, unless something hides it there."""
    pair, beside = pair_and_right
    disparity_px = CAMERA.fx * CAMERA.baseline_m / pair.depth_m
    x, y = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
    there = CAMERA.fx * CAMERA.baseline_m / beside.depth_m
    carried_px = cv2.remap(there, x - disparity_px, y, cv2.INTER_LINEAR)
    inside = (x - disparity_px > 1) & (x < WIDTH - 2)
    smooth = smooth_over(disparity_px) & (
        cv2.remap(smooth_over(there).astype(np.float32), x - disparity_px, y, 1) > 0.99
    )
    error_px = np.abs(carried_px - disparity_px)[inside & smooth]
    same_surface = error_px < 0.5
    assert same_surface.mean() > 0.9
    assert np.quantile(error_px[same_surface], 0.98) < 0.1


def smooth_over(disparity_px):
    """Where no edge between near and far lies within a pixel."""
    reach = cv2.dilate(disparity_px, np.ones((3, 3))) - cv2.erode(disparity_px, np.ones((3, 3)))
    return reach < 0.5


def test_texture_lies_where_depth_says(pair_and_right):
    """The shift that brings the right picture, carried by depth, onto the left one is below a tenth of a pixel."""
    pair, beside = pair_and_right
    disparity_px = CAMERA.fx * CAMERA.baseline_m / pair.depth_m
    x, y = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
    left, right = (np.log(light.mean(axis=2) + 0.02) for light in (pair.left, pair.right))
    carried = cv2.remap(right, x - disparity_px, y, cv2.INTER_CUBIC)
    there = cv2.remap(CAMERA.fx * CAMERA.baseline_m / beside.depth_m, x - disparity_px, y, cv2.INTER_LINEAR)
    usable = smooth_over(disparity_px) & (np.abs(there - disparity_px) < 0.2) & (x - disparity_px > 2)
    slope = cv2.Sobel(left, cv2.CV_32F, 1, 0, scale=1 / 8)
    usable &= (np.abs(slope) < 0.3) & (np.abs(left - carried) < 0.3)
    shift_px = (slope * (carried - left))[usable].sum() / (slope**2)[usable].sum()
    assert usable.sum() > 5000
    assert abs(shift_px) < 0.1


def test_depth_of_the_ground_is_that_of_its_plane():
    nothing = only(simple_row(0))
    (pair,) = drawn(nothing, pose(z_m=1.3))
    down = CAMERA.rays(centres_px())[..., 1]
    seen = (down > 0) & (1.3 / np.maximum(down, 1e-9) < 100.0)
    assert np.allclose(pair.depth_m[seen], 1.3 / down[seen], rtol=1e-4)
    assert np.isinf(pair.depth_m[down < 0]).all()
    assert not pair.ids.any()


def test_a_fruit_covers_its_outline_and_no_more(row):
    for number in range(3):
        alone = only(row, fruits=[number])
        centre = alone.fruits.centres_m[0]
        (pair,) = drawn(alone, pose(centre[0] + 0.1, centre[1] - 1.0, centre[2] + 0.05))
        expected = full_pixels(alone.fruits, CAMERA, pose(centre[0] + 0.1, centre[1] - 1.0, centre[2] + 0.05))[0]
        shown = pair.ids == alone.fruits.ids[0]
        outline_px = np.pi * np.sqrt(4.0 * expected / np.pi)
        assert abs(shown.sum() - expected) < 0.5 * outline_px
        depth_m = pair.depth_m[shown]
        radius_m = 0.5 * alone.fruits.diameters_m[0]
        assert abs(depth_m.min() - (1.0 - radius_m)) < 0.2 * radius_m


def test_the_centre_of_a_fruit_in_the_open_shows_its_id(row, pair_and_right):
    pair = pair_and_right[0]
    boxes = boxes_in(pair.ids, row.fruits, CAMERA, pose())
    in_the_open = boxes.ids[boxes.visible > 0.95]
    assert len(in_the_open) >= 3
    for number in in_the_open:
        x, y, z = (row.fruits.centres_m[row.fruits.ids == number][0] - pose()[:3, 3]) @ LOOKING
        column, line = CAMERA.fx * x / z + CAMERA.cx, CAMERA.fy * y / z + CAMERA.cy
        assert pair.ids[int(line), int(column)] == number


def test_what_shows_is_never_more_than_the_whole(row, pair_and_right):
    boxes = boxes_in(pair_and_right[0].ids, row.fruits, CAMERA, pose())
    assert ((boxes.visible > 0) & (boxes.visible <= 1)).all()
    inside = (boxes.boxes_px >= 0) & (boxes.boxes_px <= [WIDTH, HEIGHT, WIDTH, HEIGHT])
    assert inside.all()


def test_fruits_without_a_label_show_no_id():
    rows = simple_row(4, behind=1, leaves=100)
    unlabelled = only(rows, fruits=np.flatnonzero(rows.fruits.ids == 0))
    (pair,) = drawn(unlabelled, pose())
    assert (np.isfinite(pair.depth_m) & (pair.depth_m < 6.5)).any()
    assert not pair.ids.any()


def test_leaves_cast_shadows_and_let_light_through(row):
    fruit = only(row, fruits=[0])
    centre = fruit.fruits.centres_m[0]
    view = pose(centre[0], centre[1] - 1.0, centre[2])
    above = replace(
        only(row, fruits=[0], leaves=[0]).leaves,
        bases_m=centre[None] + [-0.15, -0.04, 0.08],
        tips=np.array([[1.0, 0.0, 0.0]]),
        normals=np.array([[0.0, 0.0, 1.0]]),
        lengths_m=np.array([0.3]),
        widths_m=np.array([0.25]),
        folds_rad=np.zeros(1),
        bends_rad=np.zeros(1),
    )
    overhead = replace(SUN, sun_elevation_rad=1.5)
    (open_sky,) = drawn(fruit, view, weather=overhead)
    (shaded,) = drawn(replace(fruit, leaves=above), view, weather=overhead)
    both = (open_sky.ids > 0) & (shaded.ids > 0)
    assert shaded.left[both].mean() < 0.5 * open_sky.left[both].mean()
    below = pose(centre[0], centre[1] - 0.9, centre[2] - 0.5)
    below[:3, :3] = LOOKING @ cv2.Rodrigues(np.array([0.6, 0.0, 0.0]))[0]
    (lit,) = drawn(replace(fruit, leaves=above), below, weather=overhead)
    is_leaf = (lit.ids == 0) & (lit.depth_m < 2.0)
    red, green, blue = lit.left[is_leaf].mean(axis=0)
    assert green > 2 * blue
    assert green > red


def test_wind_moves_leaves_and_nothing_else(row):
    still, gusty = (drawn(row, pose(), pose(), weather=replace(OVERCAST, wind_m=wind_m)) for wind_m in (0.0, 0.01))
    assert np.array_equal(still[0].left, still[1].left)
    assert not np.array_equal(gusty[0].depth_m, gusty[1].depth_m)
    both = (gusty[0].ids > 0) & (gusty[0].ids == gusty[1].ids)
    assert np.array_equal(gusty[0].depth_m[both], gusty[1].depth_m[both])


def test_pairs_from_a_number_on_are_those_of_the_whole(row):
    poses = np.stack([pose(), pose(1.2), pose(1.4)])
    windy = replace(SUN, wind_m=0.005)
    whole = list(RasterRenderer().render(row, CAMERA, poses, windy, 1))
    rest = list(RasterRenderer().render(row, CAMERA, poses, windy, 1, first=2))
    assert len(rest) == 1
    assert np.array_equal(whole[2].left, rest[0].left)
    assert np.array_equal(whole[2].depth_m, rest[0].depth_m)


SCRIPT = """
import hashlib, sys
import numpy as np
from simple_row import simple_row
import test_render as here
pair = here.drawn(simple_row(2, leaves=400), here.pose())[0]
print(hashlib.sha256(b"".join(part.tobytes() for part in pair.__dict__.values())).hexdigest())
"""


def test_the_number_of_threads_changes_nothing():
    here = Path(__file__).parent
    path = os.pathsep.join([str(here), str(here.parent / "python"), os.environ.get("PYTHONPATH", "")])
    prints = [
        subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env={**os.environ, "RAYON_NUM_THREADS": str(threads), "PYTHONPATH": path},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in (1, 3)
    ]
    assert len(prints[0].strip()) == hashlib.sha256().digest_size * 2
    assert prints[0] == prints[1]


@pytest.mark.parametrize(
    ("part", "changed", "said"),
    [
        ("fruits", {"ids": np.array([70_000])}, "ids: found one outside 0 to 65535"),
        ("fruits", {"axes": np.zeros((1, 2))}, "axes: found an array of shape"),
        ("fruits", {"heights_m": np.zeros(2)}, "heights_m: found 2 numbers, expected 1"),
        ("leaves", {"lengths_m": np.array([np.nan])}, "lengths_m: found a number that is not finite"),
        ("limbs", {"colours": np.full((1, 3), np.inf)}, "colours: found a number that is not finite"),
    ],
)
def test_arrays_are_looked_at_where_they_come_in(row, part, changed, said):
    small = only(row, fruits=[0], leaves=[0], limbs=[0])
    wrong = replace(small, **{part: replace(getattr(small, part), **changed)})
    with pytest.raises(ValueError, match=said):
        _core.RowScene(wrong, CAMERA, pose()[None], SUN, seed=0)
