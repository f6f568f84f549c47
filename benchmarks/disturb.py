"""What is done to a real cloud before it is matched: fruits hidden, false ones added, all of it moved."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pomona.cloud import FruitCloud


def hidden(rng: np.random.Generator, cloud: FruitCloud, share: float) -> FruitCloud:
    """Drop each fruit with probability `share`."""
    return cloud.select(np.flatnonzero(rng.random(len(cloud)) >= share))


def dropped(rng: np.random.Generator, cloud: FruitCloud, share: float) -> FruitCloud:
    """Drop this share of the fruits, rounded."""
    return cloud.select(np.sort(rng.permutation(len(cloud))[round(share * len(cloud)) :]))


def with_false_points(rng: np.random.Generator, cloud: FruitCloud, count: int, name: str) -> FruitCloud:
    """Add `count` points, uniform in the cloud's box; their ids start with `name`. Other columns but ids are lost."""
    places = rng.uniform(cloud.positions.min(axis=0), cloud.positions.max(axis=0), (count, 3))
    ids = (*(cloud.ids or ()), *(f"{name}{number}" for number in range(count)))
    covariances = cloud.covariances
    if covariances is not None:
        covariances = np.concatenate([covariances, covariances[rng.integers(len(cloud), size=count)]])
    return FruitCloud(np.concatenate([cloud.positions, places]), ids=ids, covariances=covariances)


def moved(rng: np.random.Generator, cloud: FruitCloud, scale: float = 1.0) -> tuple[FruitCloud, NDArray[np.float64]]:
    """Turn, scale, move and shuffle the cloud: the new cloud, and the (4, 4) `old_from_new`."""
    new_from_old = np.eye(4)
    new_from_old[:3, :3] = scale * Rotation.random(random_state=rng).as_matrix()
    new_from_old[:3, 3] = scale * rng.uniform(-20.0, 20.0, 3)
    return cloud.select(rng.permutation(len(cloud))).transformed(new_from_old), np.linalg.inv(new_from_old)
