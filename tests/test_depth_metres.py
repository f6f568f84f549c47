"""Pictures of depth that do not hold metres."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from depth_scene import CAMERA, Sphere, box_of, picture
from pomona.survey.depth_metres import fault_of_metres

Depth = NDArray[np.float32]

RNG = np.random.default_rng(4)
FRAMES = [
    [Sphere((x, y, float(RNG.uniform(0.9, 1.8))), float(RNG.normal(0.07, 0.007))) for x in (-0.4, -0.2, 0, 0.2, 0.4)]
    for y in (-0.2, 0.0, 0.2, 0.3)
]
BOXES = {frame: np.array([box_of(sphere) for sphere in spheres]) for frame, spheres in enumerate(FRAMES)}
DEPTHS = {frame: picture(spheres) for frame, spheres in enumerate(FRAMES)}


def told(made: Callable[[Depth], Depth]) -> str | None:
    return fault_of_metres({frame: made(depth_m) for frame, depth_m in DEPTHS.items()}, BOXES, CAMERA)


def test_metres_are_left_alone() -> None:
    assert told(lambda depth_m: depth_m) is None


def test_depth_with_holes_noise_and_steps_is_left_alone() -> None:
    rng = np.random.default_rng(1)

    def measured(depth_m: Depth) -> Depth:
        noisy = np.round((depth_m + rng.normal(0, 0.03, depth_m.shape)) / 0.04) * 0.04
        return np.where(rng.random(depth_m.shape) < 0.4, 0, noisy).astype(np.float32)

    assert told(measured) is None


@pytest.mark.parametrize("times", [10.0, 5.0, 1e-3, 1e3])
def test_another_unit_is_told_with_how_wide_fruits_are(times: float) -> None:
    found = told(lambda depth_m: np.float32(times) * depth_m)
    assert found is not None
    assert found.endswith("expected 10 to 250 mm: check depth_unit_m 0.001, fx 600 px")
    assert float(found.split()[2]) == pytest.approx(70 * times, rel=0.1)


def test_disparities_are_told() -> None:
    found = told(lambda depth_m: (1.2 / depth_m).astype(np.float32))
    assert found is not None
    assert found.startswith("larger boxes are deeper in the depth pictures")


def test_pictures_without_depth_are_told() -> None:
    assert told(np.zeros_like) == "depth is in 0 of 20 boxes, expected in most: check the depth pictures"


def test_of_few_boxes_nothing_is_said() -> None:
    assert fault_of_metres({0: 10 * DEPTHS[0]}, BOXES, CAMERA) is None
    assert fault_of_metres({}, {}, CAMERA) is None
