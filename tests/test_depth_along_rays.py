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


def leaves_before_a_fine_wall(folder: Path, *, along_rays: bool) -> Recording:
    """Discs 1.3 to 1.8 m away before a wall at 5.5 m, whose texture is as fine as pixels: a tracker leads it astray."""
    rng, (width, height, focal) = np.random.default_rng(4), (640, 480, 480.0)
    wall = rng.integers(60, 140, (400, 800))
    middles = np.column_stack([rng.uniform(-1.0, 3.5, 260), rng.uniform(-0.9, 0.9, 260), rng.uniform(1.3, 1.8, 260)])
    shades = rng.integers(20, 200, 260)
    x, y = np.meshgrid((np.arange(width) + 0.5 - 320) / focal, (np.arange(height) + 0.5 - 240) / focal)
    for side in ("left", "depth"):
        (folder / side).mkdir(parents=True)
    for row in range(N_FRAMES):
        aside = 0.12 * row
        picture = wall[((5.5 * y + 4.0) * 40).astype(int), ((5.5 * x + aside + 4.2) * 40).astype(int)].astype(np.uint8)
        depth_m = np.full((height, width), 5.5)
        for (east, down, deep), shade in zip(middles, shades, strict=True):
            ends = [focal * (at + side) / deep for at in (east - aside, down) for side in (-0.05, 0.05)]
            left, right, top, bottom = np.round(np.add(ends, [320, 320, 240, 240])).astype(int).clip(0, 640)
            here = np.s_[top:bottom, left:right]
            off = np.stack([deep * x[here] + aside - east, deep * y[here] - down])
            is_leaf = ((off**2).sum(axis=0) < 0.05**2) & (depth_m[here] > deep)
            checks = (np.floor(off / 0.012).sum(axis=0) % 2).astype(bool)
            picture[here][is_leaf] = np.where(checks, shade, shade + 50)[is_leaf]
            depth_m[here][is_leaf] = deep
        told_m = depth_m * np.sqrt(1 + x**2 + y**2) if along_rays else depth_m
        told_m = told_m + rng.normal(0.0, 0.001, told_m.shape) * told_m**2
        cv2.imwrite(str(folder / "left" / f"{row:04d}.png"), cv2.GaussianBlur(picture, (0, 0), 0.6))
        cv2.imwrite(str(folder / "depth" / f"{row:04d}.png"), np.round(1000 * told_m).astype(np.uint16))
    camera = {"width": width, "height": height, "fx": focal, "fy": focal, "cx": 320.0, "cy": 240.0}
    (folder / "calibration.json").write_text(json.dumps(camera))
    return open_recording(folder)


@pytest.mark.parametrize("along_rays", [False, True])
def test_a_texture_that_leads_a_tracker_astray_is_let_go(tmp_path: Path, along_rays: bool) -> None:
    told = depth_along_rays(leaves_before_a_fine_wall(tmp_path / "row", along_rays=along_rays))
    assert (told is not None) == along_rays
