"""Fruits whose depth is hardly known, as those of rows behind, say little of a pose, none against the true one."""

import numpy as np
from benchmarks.row_drive import Array, pose_at

from pomona import FruitCloud, Localizer

ROWS, APART_M, LENGTH_M = 4, 3.2, 16.0
NEAR_M = 2.6
SEEN, SEEN_BEHIND = 0.6, 0.25
FRAMES = 20


def walls(rng: np.random.Generator) -> Array:
    """Flat walls of fruits behind each other, 35 fruits a metre."""
    n = int(35 * LENGTH_M)
    low, high = np.array([0.0, 0.0, 0.5]), np.array([LENGTH_M, 0.0, 2.5])
    return np.concatenate(
        [
            rng.uniform(low, high, (n, 3)) + rng.normal(0, 0.05, (n, 3)) * (0, 1, 0) + (0, APART_M * row, 0)
            for row in range(ROWS)
        ]
    )


def seen_through(fruits: Array, pose: Array, rng: np.random.Generator) -> FruitCloud:
    """What a camera sees of all rows: a direction well, a depth worse by its square."""
    camera_from_map = np.linalg.inv(pose)
    places = fruits @ camera_from_map[:3, :3].T + camera_from_map[:3, 3]
    depth = places[:, 2]
    in_view = (np.abs(places[:, :2]) < np.array([0.6, 0.45]) * depth[:, None]).all(axis=1) & (depth < 5.0)
    shown = rng.random(len(places)) < np.where(depth < NEAR_M, SEEN, SEEN_BEHIND)
    places = places[in_view & shown]
    z = places[:, 2]
    aside, along = 0.004 * z, 0.03 * z * z
    rays = places / np.linalg.norm(places, axis=1)[:, None]
    outer = rays[:, :, None] * rays[:, None, :]
    covariances = aside[:, None, None] ** 2 * (np.eye(3) - outer) + along[:, None, None] ** 2 * outer
    noise = np.einsum("nij,nj->ni", np.linalg.cholesky(covariances), rng.normal(size=places.shape))
    return FruitCloud(positions=places + noise, covariances=covariances)


def test_what_is_seen_of_the_rows_behind_speaks_for_a_pose() -> None:
    rng = np.random.default_rng(5)
    hanging = walls(rng)
    on_map = hanging[rng.random(len(hanging)) < 0.9]
    on_map = on_map + rng.normal(0, 0.006, on_map.shape)
    map = FruitCloud(positions=on_map, covariances=np.tile(0.006**2 * np.eye(3), (len(on_map), 1, 1)))
    today = hanging + rng.normal(0, 0.01, hanging.shape)
    localizer = Localizer(map, threads=1)
    more, n_far, off_m = [], 0, []
    for number in range(FRAMES):
        pose = pose_at(3.0 + 0.5 * number, turn_deg=4.0 * np.sin(number))
        seen = seen_through(today, pose, rng)
        is_near = seen.positions[:, 2] < NEAR_M
        n_far += np.count_nonzero(~is_near)
        of_all, of_near = localizer.locate(seen), localizer.locate(seen.select(np.flatnonzero(is_near)))
        if of_near.status != "Found":
            continue
        assert of_all.status == "Found"
        off_m.append([np.linalg.norm(found.position_m - pose[:3, 3]) for found in (of_all, of_near)])
        more.append(of_all.log_odds - of_near.log_odds)
    assert n_far > 10 * FRAMES
    assert len(more) > 0.8 * FRAMES
    assert min(more) >= 0
    assert np.median(more) > 20
    of_all_m, of_near_m = np.median(off_m, axis=0)
    assert of_all_m < 0.6 * of_near_m
    assert np.max(off_m) < 0.1
