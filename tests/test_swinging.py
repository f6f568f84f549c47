"""Fruits that swing in the wind while they are filmed are counted once, and told."""

from pathlib import Path

import numpy as np
import pytest

from pomona import PomonaWarning
from pomona.detect import Detections
from pomona.recording.calibration import Calibration
from pomona.survey.believing import Believing
from pomona.survey.depth import Lifted
from pomona.survey.part import OpenPart
from pomona.survey.seeing import Look
from pomona.survey.swinging import allowing, tell_swing
from pomona.survey.tracking import Tracker

CAMERA = Calibration(width=640, height=360, fx=417.0, fy=417.0, cx=320.0, cy=180.0, baseline_m=0.12)
RADIUS_M = 0.035
STEP_M = 0.14
SIGMAS_M = np.array([0.002, 0.002, 0.01])
FRAMES = 40
PERIOD = 15
"""Frames of one swing to and fro."""


def clusters(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Fruits of a row 1.5 m away, and the number of the cluster that each hangs in."""
    middles = np.column_stack([rng.uniform(-1.0, 6.5, 60), rng.uniform(-0.5, 0.5, 60), rng.uniform(1.4, 1.7, 60)])
    sizes = rng.integers(1, 4, len(middles))
    of_fruit = np.repeat(np.arange(len(middles)), sizes)
    places = middles[of_fruit] + 0.09 * np.concatenate([np.arange(n) for n in sizes])[:, None] * [0.3, 1.0, 0.2]
    return places, of_fruit


def looks(swing_m: float, pose_sigma_m: float, seed: int) -> tuple[list[Look], np.ndarray, int]:
    """Frames past a row whose clusters swing for themselves, poses as they are told, fruits seen five times."""
    rng = np.random.default_rng(seed)
    places, cluster = clusters(rng)
    phases = rng.uniform(0, 2 * np.pi, cluster.max() + 1)[cluster]
    found, poses, times_seen = [], np.tile(np.eye(4), (FRAMES, 1, 1)), np.zeros(len(places), int)
    for frame in range(FRAMES):
        swung = places + swing_m * np.sin(2 * np.pi * frame / PERIOD + phases)[:, None] * [1.0, 0.0, 0.0]
        centres = swung - [STEP_M * frame, 0.0, 0.0]
        middle = CAMERA.fx * centres[:, :2] / centres[:, 2:] + [CAMERA.cx, CAMERA.cy]
        half = CAMERA.fx * RADIUS_M / centres[:, 2:]
        boxes = np.hstack([middle - half, middle + half]) + rng.normal(0, 0.7, (len(places), 4))
        inside = (boxes[:, :2] > 2).all(axis=1) & (boxes[:, 2:] < [638, 358]).all(axis=1)
        shown = np.flatnonzero(inside & (rng.uniform(size=len(places)) < 0.8))
        times_seen[shown] += 1
        lifted = Lifted(
            rows=np.arange(len(shown)),
            centres_in_camera=centres[shown] + rng.normal(0, SIGMAS_M, (len(shown), 3)),
            covariances=np.tile(np.diag(SIGMAS_M**2), (len(shown), 1, 1)),
            diameters_m=2 * RADIUS_M + rng.normal(0, 0.003, len(shown)),
            diameter_sigmas_m=np.full(len(shown), 0.003),
            hidden=np.full(len(shown), 0.02),
            support=np.ones(len(shown)),
            refused={},
        )
        found.append(Look(frame, Detections(boxes[shown], np.ones(len(shown))), lifted))
        poses[frame, :3, 3] = rng.normal([STEP_M * frame, 0.0, 0.0], pose_sigma_m)
    return found, poses, int(np.count_nonzero(times_seen >= 5))


def scanned(swing_m: float, pose_sigma_m: float = 0.0, seed: int = 0) -> tuple[int, int, float]:
    """Fruits that are counted and that there are, and the swing that is measured, metres."""
    frames, poses, n_fruits = looks(swing_m, pose_sigma_m, seed)
    part = OpenPart(0, None, lambda allowed_m: Tracker(CAMERA, allowing({}, allowed_m)), Believing(CAMERA, {}))
    for look, pose in zip(frames, poses, strict=True):
        part.add(look, float(look.frame), pose)
    closed = part.closed(poses)
    assert closed.cloud.covariances is not None
    assert np.linalg.eigvalsh(closed.cloud.covariances).min() >= closed.swing_m**2
    return len(closed.cloud), n_fruits, closed.swing_m


@pytest.mark.parametrize("seed", [0, 1])
def test_a_row_in_the_wind_is_counted_once(seed: int) -> None:
    counted, there, swing = scanned(0.025, seed=seed)
    assert abs(counted - there) <= 0.05 * there
    assert 0.006 < swing < 0.02  # the deviation of a swing of 25 mm is 18 mm; a fruit is in view for half of one


def test_still_air_and_poses_that_shift_whole_frames_are_no_wind() -> None:
    counted, there, swing = scanned(0.0)
    assert abs(counted - there) <= 0.02 * there
    assert swing < 0.001
    assert scanned(0.0, pose_sigma_m=0.003)[2] < 0.001


def test_wind_is_told(tmp_path: Path) -> None:
    with pytest.warns(PomonaWarning, match=r"scatters by 9 mm .* swing in wind, or of poses that are off"):
        tell_swing(tmp_path, [0.0, 0.009])
    tell_swing(tmp_path, [0.003])
    tell_swing(tmp_path, [])
