"""What the core is called with is looked at where it comes in: a wrong argument is a ValueError, never a panic."""

from types import SimpleNamespace

import numpy as np
import pytest

from pomona import _core

HEIGHT, WIDTH = 48, 64
PICTURE = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
BOXES_PX = np.array([[10.0, 10.0, 30.0, 30.0], [40.0, 20.0, 60.0, 40.0]])


def camera(**changes):
    return SimpleNamespace(
        **{"width": WIDTH, "height": HEIGHT, "fx": 60.0, "fy": 60.0, "cx": 32.0, "cy": 24.0, **changes}
    )


def read_pair(seen_by=None, focal_baseline_px_m=7.2, nearest_m=0.3):
    shifted = np.ascontiguousarray(np.roll(PICTURE, -5, axis=1))
    return _core.read_pair(
        PICTURE, shifted, BOXES_PX, seen_by or camera(), focal_baseline_px_m=focal_baseline_px_m, nearest_m=nearest_m
    )


@pytest.mark.parametrize("number", [np.nan, np.inf, 0.0, -1.0])
def test_a_pair_needs_numbers_above_0(number):
    for name in ("focal_baseline_px_m", "nearest_m"):
        with pytest.raises(ValueError, match=f"{name}: found .*, expected a finite number above 0"):
            read_pair(**{name: number})
    for name in ("fx", "fy"):
        with pytest.raises(ValueError, match="camera: found"):
            read_pair(camera(**{name: number}))


@pytest.mark.parametrize(
    ("focal_baseline_px_m", "nearest_m"), [(1e300, 0.3), (1e9, 1e-9), (1e-9, 1e300), (7.2, 5e-324)]
)
def test_a_pair_of_an_absurd_baseline_is_searched_no_wider_than_its_pictures(focal_baseline_px_m, nearest_m):
    depth_m, fruits = read_pair(focal_baseline_px_m=focal_baseline_px_m, nearest_m=nearest_m)
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
