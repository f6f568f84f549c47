"""What the core is called with is looked at where it comes in: a wrong argument is a ValueError, never a panic."""

from types import SimpleNamespace

import numpy as np
import pytest

from pomona import _core

HEIGHT, WIDTH = 48, 64
PICTURE = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
BOXES_PX = np.array([[10.0, 10.0, 30.0, 30.0], [40.0, 20.0, 60.0, 40.0]])


def camera(**changes):
    optics = {"fx": 60.0, "fy": 60.0, "cx": 32.0, "cy": 24.0, "baseline_m": 0.12}
    return SimpleNamespace(**{"width": WIDTH, "height": HEIGHT, **optics, **changes})


def read_pair(seen_by=None, nearest_m=0.3):
    shifted = np.ascontiguousarray(np.roll(PICTURE, -5, axis=1))
    return _core.read_pair(PICTURE, shifted, BOXES_PX, seen_by or camera(), nearest_m=nearest_m)


@pytest.mark.parametrize("number", [np.nan, np.inf, 0.0, -1.0])
def test_a_pair_needs_numbers_above_0(number):
    with pytest.raises(ValueError, match=r"nearest_m: found .*, expected a finite number above 0"):
        read_pair(nearest_m=number)
    with pytest.raises(ValueError, match=r"camera: found baseline_m .*, expected a finite number above 0"):
        read_pair(camera(baseline_m=number))
    for name in ("fx", "fy"):
        with pytest.raises(ValueError, match="camera: found"):
            read_pair(camera(**{name: number}))


@pytest.mark.parametrize(("baseline_m", "nearest_m"), [(1e298, 0.3), (1e7, 1e-9), (1e-11, 1e300), (0.12, 5e-324)])
def test_a_pair_of_an_absurd_baseline_is_searched_no_wider_than_its_pictures(baseline_m, nearest_m):
    depth_m, fruits = read_pair(camera(baseline_m=baseline_m), nearest_m)
    assert depth_m.shape == (HEIGHT, WIDTH)
    assert fruits.shape == (len(BOXES_PX), 3)


def test_a_camera_is_finite():
    depth_m, sources = np.full((HEIGHT, WIDTH), 1.5, np.float32), np.full((len(BOXES_PX), 3), np.nan)
    for name in ("fx", "cx", "cy"):
        with pytest.raises(ValueError, match="camera: found"):
            _core.lift(depth_m, BOXES_PX, sources, camera(**{name: np.nan}))


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_codes_are_of_finite_places(number):
    positions = np.random.default_rng(0).normal(size=(12, 3))
    positions[7, 1] = number
    with pytest.raises(ValueError, match="positions: row 7 is NaN or infinite"):
        _core.describe(positions, 4, 8)


def test_two_pictures_need_a_baseline():
    with pytest.raises(ValueError, match="camera: found no baseline_m, expected one of a stereo pair"):
        read_pair(camera(baseline_m=None))


SHEARED = np.eye(4) + np.eye(4, k=1)


@pytest.mark.parametrize("pose", [SHEARED, 1.1 * np.eye(4), np.full((4, 4), np.nan)], ids=["sheared", "scaled", "nan"])
def test_every_pose_is_looked_at_where_it_comes_in(pose):
    places, empty = np.zeros((0, 3)), np.zeros((0, 3, 3))
    told = "session_from_camera: found a matrix that does not turn and move"
    with pytest.raises(ValueError, match=told):
        _core.locate(camera(), places, empty, np.zeros((0, 2)), pose, sigma_px=0.5)
    with pytest.raises(ValueError, match=told):
        adjusted(pose[None])


def adjusted(poses):
    return _core.adjust(
        None,
        poses,
        np.ones(len(poses), bool),
        np.zeros((0, 3)),
        pictures=None,
        places=None,
        relative_poses=None,
        wanted=[],
        max_steps=0,
        first_scale=None,
    )


def test_a_pose_crosses_the_border_to_the_last_bit():
    turned = np.eye(4)
    turned[:2, :2], turned[:3, 3] = [[0.8, -0.6], [0.6, 0.8]], [0.1, 1 / 3, 1e-9]
    np.testing.assert_array_equal(adjusted(turned[None])[0][0], turned)
    with pytest.raises(ValueError, match=r"poses: found an array of shape \[1, 3, 4\], expected \(F, 4, 4\)"):
        adjusted(turned[None, :3])
