"""Refinement of poses and fruits over a session."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pomona import PomonaError
from pomona.survey.refinement import Motions, SeenFruits, refine

SIGMA_M = np.array([0.004, 0.004, 0.02])
STEP_SIGMA = np.array([0.005, 0.005, 0.005, 0.002, 0.002, 0.002])


def moved(pose: NDArray[np.float64], step: NDArray[np.float64]) -> NDArray[np.float64]:
    change = np.eye(4)
    change[:3, :3] = Rotation.from_rotvec(step[3:]).as_matrix()
    change[:3, 3] = step[:3]
    return pose @ change


class Row:
    """A drive there and back along fruits: truth, drifting odometry, sightings."""

    def __init__(self, seed: int = 0, wrong: float = 0.0) -> None:
        rng = np.random.default_rng(seed)
        along = np.concatenate([np.arange(25), np.arange(25)[::-1]]) * 0.1
        self.poses = np.tile(np.eye(4), (50, 1, 1))
        self.poses[:, 0, 3] = along
        self.fruits = np.column_stack(
            [rng.uniform(-0.6, 3.0, 80), rng.uniform(-0.5, 0.5, 80), rng.uniform(1.0, 2.0, 80)]
        )
        drifting, relative = [self.poses[0]], []
        for row in range(1, 50):
            true = np.linalg.inv(self.poses[row - 1]) @ self.poses[row]
            relative.append(moved(true, STEP_SIGMA * rng.normal(size=6)))
            drifting.append(drifting[-1] @ relative[-1])
        self.drifting = np.array(drifting)
        information = np.tile(np.diag(STEP_SIGMA**-2), (49, 1, 1))
        self.motions = Motions(np.arange(49), np.arange(1, 50), np.array(relative), information)
        frames, fruits = np.nonzero(np.abs(self.fruits[None, :, 0] - along[:, None]) < 0.6)
        fruits = np.unique(fruits, return_inverse=True)[1] if len(np.unique(fruits)) < 80 else fruits
        seen = self.fruits[fruits] - self.poses[frames, :3, 3] + SIGMA_M * rng.normal(size=(len(frames), 3))
        bad = rng.uniform(size=len(frames)) < wrong
        seen[bad] += rng.normal(0.0, 0.3, (int(bad.sum()), 3))
        covariances = np.tile(np.diag(SIGMA_M**2), (len(frames), 1, 1))
        self.sightings = SeenFruits(frames, fruits, seen, covariances)

    def shift_m(self, poses: NDArray[np.float64]) -> float:
        return float(np.linalg.norm(poses[-1][:3, 3] - self.poses[-1][:3, 3]))


def test_fruits_that_are_seen_again_take_the_drift_away() -> None:
    row = Row()
    found = refine(row.drifting, row.sightings, row.motions)
    assert row.shift_m(row.drifting) > 0.03
    assert row.shift_m(found.session_from_camera) < 0.01
    np.testing.assert_array_equal(found.session_from_camera[0], row.drifting[0])
    assert np.median(np.linalg.norm(found.centres - row.fruits, axis=1)) < 0.01
    assert np.mean(found.squared_errors) == pytest.approx(3.0, abs=0.4)


def test_wrong_sightings_hardly_pull() -> None:
    row = Row(wrong=0.1)
    found = refine(row.drifting, row.sightings, row.motions)
    assert row.shift_m(found.session_from_camera) < 0.01
    assert np.median(np.linalg.norm(found.centres - row.fruits, axis=1)) < 0.01


def test_trusted_poses_stay_and_covariances_are_those_of_the_errors() -> None:
    row = Row()
    found = refine(row.poses, row.sightings)
    np.testing.assert_array_equal(found.session_from_camera, row.poses)
    errors = found.centres - row.fruits
    squared = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(found.covariances), errors)
    # The mean of 80 chi^2 of 3 degrees is 3 +- 0.27; Cauchy's weights make the covariances a third larger.
    assert 1.5 < squared.mean() < 3.6


def test_a_session_without_fruits_keeps_its_motions() -> None:
    row = Row()
    nothing = SeenFruits(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))
    found = refine(row.drifting, nothing, row.motions)
    np.testing.assert_allclose(found.session_from_camera, row.drifting, atol=1e-9)
    assert found.centres.shape == (0, 3)


def test_a_long_session_takes_no_longer_than_its_length() -> None:
    # 3,000 frames: a dense matrix of its poses would have 2.6 GB.
    n = 3000
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, 0, 3] = 0.05 * np.arange(n)
    rng = np.random.default_rng(1)
    fruits = np.column_stack([np.arange(n) * 0.05, rng.uniform(-0.5, 0.5, n), rng.uniform(1.0, 2.0, n)])
    frames = np.repeat(np.arange(n), 9)
    seen = frames + np.tile(np.arange(-4, 5), n)
    inside = (seen >= 0) & (seen < n)
    frames, seen = frames[inside], seen[inside]
    places = fruits[seen] - poses[frames, :3, 3] + SIGMA_M * rng.normal(size=(len(frames), 3))
    covariances = np.tile(np.diag(SIGMA_M**2), (len(frames), 1, 1))
    relative = np.linalg.inv(poses[:-1]) @ poses[1:]
    information = np.tile(np.diag(STEP_SIGMA**-2), (n - 1, 1, 1))
    motions = Motions(np.arange(n - 1), np.arange(1, n), relative, information)
    found = refine(poses, SeenFruits(frames, seen, places, covariances), motions)
    assert np.mean(found.squared_errors) == pytest.approx(2.5, abs=0.6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frames": np.array([0, 50])}, "a row of a frame outside the 50 poses"),
        ({"fruits": np.array([0, 2])}, "fruit 1 was never seen"),
        ({"covariances": np.zeros((2, 3, 3))}, "not positive definite"),
        ({"centres_in_camera": np.full((2, 3), np.nan)}, "NaN or infinite"),
        ({"centres_in_camera": np.zeros((3, 3))}, "found shapes"),
    ],
)
def test_wrong_sightings_are_refused(change: dict[str, NDArray[np.generic]], message: str) -> None:
    row = Row()
    arrays = {
        "frames": np.array([0, 1]),
        "fruits": np.array([0, 1]),
        "centres_in_camera": np.ones((2, 3)),
        "covariances": np.tile(np.eye(3), (2, 1, 1)),
    }
    with pytest.raises(PomonaError, match=message):
        refine(row.drifting, SeenFruits(**(arrays | change)), row.motions)
