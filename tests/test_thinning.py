"""Every k-th pose adjusted, the others following: when, with which motions between, and to where."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pomona.survey.refinement import Motions
from pomona.survey.thinning import MAX_COST, between_keys, followed, stride


def passes(n_frames, length, views):
    """Frames that go along a row of `length` frames again and again; each fruit is in `views` frames of a pass."""
    frames = np.arange(n_frames)
    rows = np.repeat(frames, views)
    fruits = (frames % length)[:, None] + np.arange(views)
    return rows, fruits.ravel()


def poses_along(n, step_m=0.18, turn=0.01):
    """A gently curving way."""
    poses = np.tile(np.eye(4), (n, 1, 1))
    step = np.eye(4)
    step[:3, :3] = Rotation.from_rotvec([0, turn, 0]).as_matrix()
    step[:3, 3] = [step_m, 0, 0]
    for k in range(1, n):
        poses[k] = poses[k - 1] @ step
    return poses


def chain(poses, sigma_m, sigma_rad):
    n = len(poses) - 1
    information = np.tile(np.diag([sigma_m**-2] * 3 + [sigma_rad**-2] * 3), (n, 1, 1))
    return Motions(np.arange(n), np.arange(1, n + 1), np.linalg.inv(poses[:-1]) @ poses[1:], information)


def test_a_row_driven_once_is_adjusted_whole_however_long():
    assert stride(*passes(10_000, 10_000, 15), 10_000) == 1
    assert stride(*passes(300, 100, 15), 300) == 1
    assert stride(np.empty(0, np.int64), np.empty(0, np.int64), 5) == 1


@pytest.mark.parametrize("n_frames", [2_000, 10_000])
def test_a_row_driven_again_and_again_is_thinned_to_what_can_be_paid(n_frames):
    rows, fruits = passes(n_frames, 40, 15)
    every = stride(rows, fruits, n_frames)
    assert every > 1
    kept = rows % every == 0
    views = np.bincount(fruits[kept], minlength=fruits.max() + 1)
    most = np.zeros(n_frames)
    np.maximum.at(most, rows[kept], views[fruits[kept]])
    assert MAX_COST / 10 < (most**2).sum() <= 1.3 * MAX_COST


def test_motions_between_keys_are_those_of_the_way_and_as_sure_as_all_their_steps():
    poses = poses_along(13)
    keys = np.array([0, 4, 12])
    found = between_keys(poses, chain(poses, 0.002, 1e-9), keys)
    np.testing.assert_allclose(poses[keys[:-1]] @ found.first_from_second, poses[keys[1:]], atol=1e-12)
    covariances = np.linalg.inv(found.information)
    np.testing.assert_allclose(np.sqrt(covariances[:, 0, 0]), 0.002 * np.sqrt([4, 8]), rtol=1e-4)
    assert (found.first.tolist(), found.second.tolist()) == ([0, 1], [1, 2])


def test_a_turn_that_errs_moves_all_that_follows():
    poses = poses_along(41, turn=0.0)
    sigma_rad = 0.002
    covariance = np.linalg.inv(between_keys(poses, chain(poses, 1e-6, sigma_rad), np.array([0, 40])).information)[0]
    rng = np.random.default_rng(0)
    ends = []
    for _ in range(2000):  # the same by chance: small turns at every step
        headings = np.cumsum(sigma_rad * rng.normal(size=40))
        ends.append((0.18 * np.sin(np.concatenate([[0.0], headings[:-1]]))).sum())
    assert np.sqrt(covariance[1, 1]) == pytest.approx(np.std(ends), rel=0.15)


def test_poses_between_follow_their_keys():
    poses = poses_along(21)
    keys = np.array([0, 10, 20])
    correction = np.eye(4)
    correction[:3, :3] = Rotation.from_rotvec([0, 0.02, 0]).as_matrix()
    correction[:3, 3] = [0.0, 0.01, 0.0]
    refined = poses[keys].copy()
    refined[1] = poses[10] @ correction
    found = followed(poses, keys, refined)
    np.testing.assert_allclose(found[keys], refined, atol=1e-12)
    halfway = np.linalg.inv(poses[5]) @ found[5]
    np.testing.assert_allclose(halfway[:3, 3], [0, 0.005, 0], atol=1e-12)
    np.testing.assert_allclose(Rotation.from_matrix(halfway[:3, :3]).as_rotvec(), [0, 0.01, 0], atol=1e-9)
