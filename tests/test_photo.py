"""Photo-real pictures: what is in them is exact, a run that was interrupted goes on, and what is missing is said."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pomona.errors import PomonaError
from pomona.recording.calibration import Calibration
from pomona.render.filming import Filming, film
from pomona.render.photo import BLENDER_PYTHON, INSTALL, PathTracer
from pomona.render.scene_view import Weather
from pomona.synth.row_geometry import FruitSolids, Leaves, Limbs, RowGeometry

CAMERA = Calibration(96, 54, 62.0, 62.0, 50.0, 25.0, 0.12)
FOREIGN = Calibration(96, 54, 62.0, 70.0, 50.0, 25.0, 0.12)
OVERCAST = Weather(0.9, -1.6, 0.0, (1, 1, 1), (0.9, 0.95, 1.0), (0.8, 0.8, 0.8))
SUN = Weather(0.9, -1.6, 3.0, (1, 1, 1), (0.3, 0.5, 1.0), (0.8, 0.8, 0.8), wind_m=0.004)

CENTRES_M = np.array([[0.0, 0.0, 1.2], [0.3, 0.2, 1.3], [-0.35, -0.1, 1.0]])
DIAMETERS_M = np.array([0.16, 0.2, 0.12])


def has_blender() -> bool:
    interpreter = os.environ.get(BLENDER_PYTHON, sys.executable)
    found = [interpreter, "-c", "import importlib.util as i, sys; sys.exit(i.find_spec('bpy') is None)"]
    return subprocess.run(found, check=False).returncode == 0


needs_blender = pytest.mark.skipif(
    not has_blender(), reason=f"needs bpy, here or in the Python named by {BLENDER_PYTHON}"
)


def geometry() -> RowGeometry:
    """Three fruits beside each other, one without a label, with a leaf out of the way and a rod behind."""
    count = len(CENTRES_M)
    up, none = np.tile([0.0, 0.0, 1.0], (count, 1)), np.full((count, 3), 0.2)
    fruits = FruitSolids(
        np.array([7, 300, 0]),
        np.zeros(count, int),
        CENTRES_M,
        DIAMETERS_M,
        DIAMETERS_M,
        up,
        none,
        none,
        np.full(count, 0.5),
        np.tile([0.0, -1.0, 0.0], (count, 1)),
    )
    one = np.ones(1)
    limbs = Limbs(np.array([[0, 0.6, 0.0]]), np.array([[0, 0.6, 2.0]]), 0.03 * one, 0.02 * one, np.full((1, 3), 0.1))
    leaves = Leaves(
        np.array([[0.0, 0.0, 1.4]]),
        np.array([[1.0, 0, 0]]),
        np.array([[0, 0, 1.0]]),
        *(0.08 * one, 0.05 * one, 0.3 * one, 0.4 * one),
        np.array([[0.05, 0.1, 0.02]]),
    )
    return RowGeometry(fruits, limbs, leaves)


def poses(count: int) -> np.ndarray:
    """In front of the row, level, looking along y."""
    made = np.tile(np.eye(4), (count, 1, 1))
    made[:, :3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    made[:, :3, 3] = [[0.02 * number, -1.0, 1.15] for number in range(count)]
    return made


def seen(camera: Calibration, session_from_camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the middles of the fruits are in the picture, by the pinhole alone: pixels, and depths in metres."""
    in_camera = np.linalg.inv(session_from_camera) @ np.c_[CENTRES_M, np.ones(len(CENTRES_M))].T
    x, y, z = in_camera[:3]
    return np.stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy], axis=-1), z


@needs_blender
@pytest.mark.parametrize("camera", [CAMERA, FOREIGN], ids=["square", "oblong"])
def test_ids_and_depths_are_those_of_the_pinhole(camera):
    (pair,) = PathTracer(samples=1).render(geometry(), camera, poses(1), OVERCAST, seed=1)
    places_px, depths_m = seen(camera, poses(1)[0])
    rows, columns = np.mgrid[: camera.height, : camera.width] + 0.5
    for number, place_px, depth_m, diameter_m in zip((7, 300), places_px, depths_m, DIAMETERS_M, strict=False):
        rays = np.stack([(columns - place_px[0]) / camera.fx, (rows - place_px[1]) / camera.fy], axis=-1) * depth_m
        away_m = np.linalg.norm(rays, axis=-1)
        # Fruits are apples and no balls: wide at the middle as the caliper says, squarer at the shoulders.
        level = np.abs(rays[..., 1]) < 0.15 * diameter_m
        assert (pair.ids[level & (away_m < 0.46 * diameter_m)] == number).all()
        assert not (pair.ids[away_m > 0.60 * diameter_m] == number).any()
        column, row = place_px.astype(int)
        # The ray to the middle meets the skin half a diameter before it.
        away = depth_m * np.linalg.norm([*((place_px - [camera.cx, camera.cy]) / [camera.fx, camera.fy]), 1.0])
        assert pair.depth_m[row, column] == pytest.approx(depth_m * (1 - diameter_m / 2 / away), abs=0.003)
        middle_px = columns[pair.ids == number].mean(), rows[pair.ids == number].mean()
        assert middle_px == pytest.approx(place_px, abs=0.35)  # a pixel is an eighth of a fruit
    assert set(np.unique(pair.ids)) == {0, 7, 300}


@needs_blender
def test_the_ground_has_the_depth_of_a_plane_and_the_sky_none():
    bare = geometry()
    (pair,) = PathTracer(samples=1).render(bare, CAMERA, poses(1), OVERCAST, seed=1)
    row = 50.5
    plane_m = 1.15 * CAMERA.fy / (row - CAMERA.cy)
    # Grass stands up from the ground, so the plane is the farthest that can be.
    assert pair.depth_m[50].max() <= plane_m + 1e-3
    assert pair.depth_m[50].max() == pytest.approx(plane_m, abs=0.1)
    assert np.isinf(pair.depth_m[:5]).any()


@needs_blender
def test_a_run_that_was_interrupted_goes_on_and_gives_the_same(tmp_path):
    whole = list(PathTracer(samples=2).render(geometry(), CAMERA, poses(3), SUN, seed=5))
    renderer = PathTracer(samples=2, folder=tmp_path / "job")
    interrupted = renderer.render(geometry(), CAMERA, poses(3), SUN, seed=5)
    next(interrupted)
    interrupted.close()
    first = (tmp_path / "job/pairs/0000.npz").stat().st_mtime_ns
    again = list(renderer.render(geometry(), CAMERA, poses(3), SUN, seed=5))
    assert (tmp_path / "job/pairs/0000.npz").stat().st_mtime_ns == first
    for one, other in zip(whole, again, strict=True):
        for name in ("left", "right", "depth_m", "ids"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    (last,) = PathTracer(samples=2).render(geometry(), CAMERA, poses(3), SUN, seed=5, first=2)
    np.testing.assert_array_equal(last.left, whole[2].left)


def test_another_job_in_the_folder_is_refused(tmp_path):
    (tmp_path / "job.json").write_text(json.dumps({"seed": 4}))
    with pytest.raises(PomonaError, match="holds the pictures of another job"):
        next(PathTracer(folder=tmp_path).render(geometry(), CAMERA, poses(1), SUN, seed=5))


def test_the_docs_and_the_extra_name_what_is_to_be_installed():
    root = Path(__file__).parents[1]
    assert INSTALL in (root / "docs" / "photo-real.md").read_text()
    assert INSTALL.removeprefix("pip install ") in (root / "pyproject.toml").read_text()


def test_without_blender_it_says_what_to_install_and_leaves_nothing(tmp_path, monkeypatch):
    # A Python without packages, so surely without Blender.
    bare = tmp_path / "bare"
    bare.write_text(f'#!/bin/sh\nexec {sys.executable} -S -E "$@"\n')
    bare.chmod(0o755)
    with pytest.raises(PomonaError, match=f"bpy, which is not installed: {INSTALL}"):
        next(PathTracer(interpreter=str(bare)).render(geometry(), CAMERA, poses(1), SUN, seed=5))
    monkeypatch.setenv(BLENDER_PYTHON, str(bare))
    with pytest.raises(PomonaError, match=f"not installed: {INSTALL}"):
        film(Filming(renderer="photo"), tmp_path / "row")
    assert not (tmp_path / "row").exists()


def test_an_interpreter_that_is_none_is_named(tmp_path):
    with pytest.raises(PomonaError, match="nowhere: cannot be run"):
        next(PathTracer(interpreter=str(tmp_path / "nowhere")).render(geometry(), CAMERA, poses(1), SUN, seed=5))


@pytest.mark.parametrize("wrong", [{"samples": 0}, {"threads": 0}])
def test_impossible_settings_are_told(wrong):
    with pytest.raises(PomonaError, match="found 0, expected a whole number from 1"):
        next(PathTracer(**wrong).render(geometry(), CAMERA, poses(1), SUN, seed=5))


@needs_blender
def test_a_graphics_card_that_is_not_there_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "")
    tracer = PathTracer(samples=1, gpu=True, folder=tmp_path)
    with pytest.raises(PomonaError, match="Blender: ended with 1: no graphics card that Blender can render with"):
        list(tracer.render(geometry(), CAMERA, np.eye(4)[None], OVERCAST, 1))
