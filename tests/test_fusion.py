import numpy as np
import pytest

from pomona.survey.fusion import fuse_centres, fuse_diameters


def long_along(direction, along_m, across_m):
    direction = np.asarray(direction, float) / np.linalg.norm(direction)
    return along_m**2 * np.outer(direction, direction) + across_m**2 * (np.eye(3) - np.outer(direction, direction))


def ahead(n):
    """Rays along z."""
    return np.tile([0.0, 0.0, 1.0], (n, 1))


def test_one_sighting_stays_as_it_is():
    covariance = long_along((0, 0, 1), 0.01, 0.002)
    centre, fused = fuse_centres(np.array([[1.0, 2.0, 3.0]]), covariance[None], np.array([[0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(centre, [1, 2, 3])
    np.testing.assert_allclose(fused, covariance)
    assert fuse_diameters(np.array([0.07]), np.array([0.004]), np.array([0.05])) == (0.07, 0.004)


def test_crossing_rays_meet_where_both_are_sure():
    # Each is off along its own ray by 2 cm and right across it.
    centres = np.array([[0.0, 0.0, 0.02], [0.02, 0.0, 0.0]])
    covariances = np.array([long_along((0, 0, 1), 0.02, 0.001), long_along((1, 0, 0), 0.02, 0.001)])
    centre, fused = fuse_centres(centres, covariances, np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
    np.testing.assert_allclose(centre, 0, atol=1e-3)
    assert np.linalg.eigvalsh(fused).max() < 0.2 * 0.02**2


def test_a_sighting_of_a_leaf_hardly_counts():
    rng = np.random.default_rng(0)
    centres = 0.003 * rng.normal(size=(9, 3))
    centres[4, 2] -= 0.25
    centre, _ = fuse_centres(centres, np.tile(0.003**2 * np.eye(3), (9, 1, 1)), ahead(9))
    assert np.linalg.norm(centre) < 0.005


def test_sightings_that_disagree_widen_the_covariance():
    covariances = np.tile(0.001**2 * np.eye(3), (6, 1, 1))
    rng = np.random.default_rng(2)
    agreeing = 0.001 * rng.normal(size=(6, 3))
    _, narrow = fuse_centres(agreeing, covariances, ahead(6))
    _, wide = fuse_centres(4 * agreeing, covariances, ahead(6))
    assert np.trace(wide) > 2 * np.trace(narrow)


def test_many_sightings_do_not_make_it_surer_than_they_are_independent():
    covariances = np.tile(0.002**2 * np.eye(3), (1000, 1, 1))
    _, fused = fuse_centres(np.zeros((1000, 3)), covariances, ahead(1000))
    assert np.sqrt(fused[0, 0]) > 0.0005
    _, sigma_m = fuse_diameters(np.full(1000, 0.07), np.full(1000, 0.003), np.full(1000, 0.01))
    assert sigma_m > 0.0005


def test_order_changes_nothing():
    rng = np.random.default_rng(1)
    centres = rng.normal(size=(5, 3))
    spread = rng.normal(size=(5, 3, 3))
    covariances = spread @ spread.transpose(0, 2, 1) + np.eye(3)
    turn = [3, 0, 4, 1, 2]
    rays = rng.normal(size=(5, 3))
    first, again = (fuse_centres(centres[of], covariances[of], rays[of])[0] for of in ([0, 1, 2, 3, 4], turn))
    np.testing.assert_allclose(first, again)


def test_diameters_that_leaves_made_smaller_give_the_true_one():
    rng = np.random.default_rng(4)
    errors = []
    for _ in range(100):
        hidden = np.full(12, 0.09)
        measured_m = 0.07 * (1 - rng.exponential(0.09, size=12)) + 0.002 * rng.normal(size=12)
        sigmas_m = np.hypot(0.002, hidden * measured_m)
        diameter_m, sigma_m = fuse_diameters(measured_m, sigmas_m, hidden)
        errors.append((diameter_m - 0.07) / sigma_m)
        assert diameter_m > measured_m.mean()
    assert abs(np.mean(errors)) < 0.5
    assert 0.3 < np.std(errors) < 1.2


def test_clear_sightings_outweigh_hidden_ones():
    measured_m = np.array([0.070, 0.0702, 0.0698, 0.05, 0.045, 0.04])
    hidden = np.array([0.01, 0.01, 0.01, 0.12, 0.12, 0.12])
    diameter_m, _ = fuse_diameters(measured_m, np.hypot(0.001, hidden * measured_m), hidden)
    assert diameter_m == pytest.approx(0.0705, abs=0.001)


@pytest.mark.parametrize("wrong", [(4,), (1, 5, 7), (0, 1, 3, 4, 5, 7, 8)])
def test_a_wrong_depth_leaves_its_ray(wrong):
    # Seen from places along x: some depths, or even most, are of the row behind; all directions are right.
    eyes = np.array([[x, 0.0, -1.5] for x in np.linspace(-0.8, 0.8, 9)])
    rays = -eyes / np.linalg.norm(eyes, axis=1, keepdims=True)
    centres = np.array([rays[k] * (0.9 if k in wrong else 0.0) for k in range(9)])
    covariances = np.array([long_along(ray, 0.03, 0.002) for ray in rays])
    centre, fused = fuse_centres(centres, covariances, rays)
    assert np.linalg.norm(centre) < 0.005
    # Directions that cross at right angles make it sure; depths that contradict each other add nothing.
    assert 0.001 < np.sqrt(np.trace(fused)) < 0.01


def test_directions_that_contradict_each_other_widen_the_covariance():
    rays = np.array([[x, 0.0, 1.5] for x in np.linspace(-0.8, 0.8, 9)])
    covariances = np.array([long_along(ray, 0.03, 0.002) for ray in rays])
    beside = np.zeros((9, 3))
    beside[:, 1] = 0.01 * np.random.default_rng(3).normal(size=9)
    _, sure = fuse_centres(np.zeros((9, 3)), covariances, rays)
    _, unsure = fuse_centres(beside, covariances, rays)
    assert np.sqrt(unsure[1, 1]) > 3 * np.sqrt(sure[1, 1])
