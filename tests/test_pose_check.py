"""Poses that came with a recording, compared with its pictures."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tests.drive_scene import CALIBRATION, drive, sideways

from pomona.errors import PomonaWarning
from pomona.recording import open_recording
from pomona.survey.pose_check import check_poses

Array = NDArray[np.float64]
START = np.eye(4)
START[:3, :3] = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()
"""So that no axis of the session is one of the camera."""


@pytest.fixture(scope="module")
def row(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Array]]:
    """Six pairs on the way to the side, and their poses."""
    folder = tmp_path_factory.mktemp("poses") / "row"
    scene = drive(sideways(6))
    for side in ("left", "right"):
        (folder / side).mkdir(parents=True)
    for number in range(6):
        for side, picture in zip(("left", "right"), scene.pictures(number)[:2], strict=True):
            cv2.imwrite(str(folder / side / f"{number:04d}.png"), picture)
    names = ("width", "height", "fx", "fy", "cx", "cy", "baseline_m")
    (folder / "calibration.json").write_text(json.dumps({name: getattr(CALIBRATION, name) for name in names}))
    return folder, [START @ pose for pose in scene.poses]


def told(row: tuple[Path, list[Array]], change: Callable[[Array], Array], order: tuple[int, ...] = (0, 1, 2, 3)) -> str:
    folder, poses = row
    lines = []
    for number, pose in enumerate(map(change, poses)):
        quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat()[list(order)]
        lines.append(" ".join(map(str, (number / 10, *pose[:3, 3], *quaternion))))
    (folder / "poses_tum.txt").write_text("\n".join(lines) + "\n")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", PomonaWarning)
        check_poses(open_recording(folder))
    return " ".join(str(one.message) for one in caught)


def longer(times: float) -> Callable[[Array], Array]:
    def change(pose: Array) -> Array:
        scaled = pose.copy()
        scaled[:3, 3] *= times
        return scaled

    return change


def test_true_poses_are_left_alone(row) -> None:
    assert told(row, lambda pose: pose) == ""


@pytest.mark.parametrize(("times", "unit"), [(1000.0, "millimetres"), (100.0, "centimetres")])
def test_units_are_told(row, times: float, unit: str) -> None:
    assert f"times as long: are they in {unit}? expected metres" in told(row, longer(times))


def test_a_scale_is_told(row) -> None:
    assert "their way is 1.0" in told(row, longer(1.06))


def test_inverted_poses_are_told(row) -> None:
    assert "they are inverted" in told(row, np.linalg.inv)


def test_the_order_of_quaternions_is_told(row) -> None:
    assert "expected x y z w" in told(row, lambda pose: pose, order=(3, 0, 1, 2))


def test_the_axes_of_a_vehicle_are_told(row) -> None:
    camera_from_body = np.linalg.inv(np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]]))
    assert "x ahead, y left, z up" in told(row, lambda pose: pose @ camera_from_body)


def test_the_axes_of_opengl_are_told(row) -> None:
    """Of a camera that goes sideways most of the way is the same in both."""
    assert "x right, y up, z back, as OpenGL has them" in told(row, lambda pose: pose @ np.diag([1.0, -1.0, -1.0, 1.0]))


def test_poses_that_stray_are_told(row) -> None:
    rng = np.random.default_rng(4)
    walked = np.zeros(3)

    def stray(pose: Array) -> Array:
        nonlocal walked
        walked = walked + rng.normal(0, 0.03, 3)
        strayed = pose.copy()
        strayed[:3, 3] += walked
        return strayed

    assert "find others with --odometry" in told(row, stray)


def test_poses_of_a_few_millimetres_are_left_alone(row) -> None:
    rng = np.random.default_rng(4)

    def shake(pose: Array) -> Array:
        shaken = pose.copy()
        shaken[:3, 3] += rng.normal(0, 0.003, 3)
        return shaken

    assert told(row, shake) == ""
