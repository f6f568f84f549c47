"""Depth pictures that hold distances along the rays."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.drive_scene import CALIBRATION, drive, sideways

from pomona.recording import Recording, open_recording
from pomona.recording.checks.along_rays import depth_along_rays

N_FRAMES = 12


def recording(folder: Path, *, along_rays: bool = False, noise: float = 0.0, stands: bool = False) -> Recording:
    """A drive past two walls, with depth in millimetres."""
    scene, rng = drive(sideways(N_FRAMES)), np.random.default_rng(2)
    columns, rows = np.meshgrid(np.arange(CALIBRATION.width) + 0.5, np.arange(CALIBRATION.height) + 0.5)
    x, y = (columns - CALIBRATION.cx) / CALIBRATION.fx, (rows - CALIBRATION.cy) / CALIBRATION.fy
    for side in ("left", "depth"):
        (folder / side).mkdir(parents=True)
    for row in range(N_FRAMES):
        left, _, depth_m = scene.pictures(0 if stands else row)
        told_m = depth_m * np.sqrt(1 + x**2 + y**2) if along_rays else depth_m
        told_m = told_m * (1 + noise * rng.normal(size=told_m.shape))
        cv2.imwrite(str(folder / "left" / f"{row:04d}.png"), left)
        cv2.imwrite(str(folder / "depth" / f"{row:04d}.png"), np.round(1000 * told_m).astype(np.uint16))
    names = ("width", "height", "fx", "fy", "cx", "cy")
    (folder / "calibration.json").write_text(json.dumps({name: getattr(CALIBRATION, name) for name in names}))
    return open_recording(folder)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_distances_are_told(pomona, tmp_path: Path, noise: float) -> None:
    row = recording(tmp_path / "row", along_rays=True, noise=noise)
    assert "distances along the rays" in (depth_along_rays(row) or "")
    code, printed, _ = pomona("info", row.path, "--check")
    assert code == 1
    assert "divide by sqrt(1 + x^2 + y^2)" in printed


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_depths_are_left_alone(tmp_path: Path, noise: float) -> None:
    assert depth_along_rays(recording(tmp_path / "row", noise=noise)) is None


def test_a_camera_that_stands_says_nothing(tmp_path: Path) -> None:
    assert depth_along_rays(recording(tmp_path / "row", along_rays=True, stands=True)) is None
