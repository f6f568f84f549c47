"""A camera before a drawn row of fruits: what it sees when the fruits hang a little elsewhere than on the map's day."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pomona import FruitCloud

Array = NDArray[np.float64]

DISTANCE_M = 1.5
"""Of the camera from the row."""

SIGMA_M = np.array([0.004, 0.004, 0.015])
"""Of a sighting, in the camera's frame: worst along the ray."""

UPRIGHT = Rotation.from_euler("x", -90, degrees=True).as_matrix()
"""Turns the camera's axes into those of a map whose z is up: it looks along y."""


@dataclass(frozen=True)
class Row:
    """Fruits as the map has them, and where they hang on the day of the drive; (N, 3) metres."""

    on_map: Array
    today: Array

    @property
    def map(self) -> FruitCloud:
        """The map, with covariances."""
        return FruitCloud(positions=self.on_map, covariances=np.tile(0.005**2 * np.eye(3), (len(self.on_map), 1, 1)))


def drawn_row(
    seed: int,
    *,
    length_m: float = 8.0,
    n: int = 320,
    own_m: float = 0.01,
    shared_m: float = 0.008,
    reach_m: float = 0.5,
    all_m: float = 0.0,
) -> Row:
    """Draw a row whose fruits moved each for itself, with their neighbours, and all together."""
    rng = np.random.default_rng(seed)
    hanging = rng.uniform((0.0, -0.35, 0.5), (length_m, 0.35, 2.5), (n, 3))
    apart = hanging[:, None] - hanging
    together = shared_m**2 * np.exp(-0.5 * (apart**2).sum(axis=2) / reach_m**2) + 1e-12 * np.eye(n)
    sag = np.linalg.cholesky(together) @ rng.normal(size=(n, 3))
    on_map = hanging + rng.normal(0, 0.005, (n, 3))
    today = hanging + sag + rng.normal(0, own_m, (n, 3))
    return Row(on_map, today + rng.normal(0, all_m, 3))


def pose_at(x_m: float, *, turn_deg: float = 0.0) -> Array:
    """Give `map_from_camera` of a camera that looks at the row from x along it."""
    pose = np.eye(4)
    pose[:3, :3] = UPRIGHT @ Rotation.from_euler("y", turn_deg, degrees=True).as_matrix()
    pose[:3, 3] = (x_m, -DISTANCE_M, 1.5)
    return pose


def seen_from(row: Row, map_from_camera: Array, seed: int, *, most: int = 60, share: float = 0.7) -> FruitCloud:
    """Draw what the camera sees: a share of the fruits in view, a few strangers, and noise."""
    rng = np.random.default_rng(seed)
    camera_from_map = np.linalg.inv(map_from_camera)
    places = row.today @ camera_from_map[:3, :3].T + camera_from_map[:3, 3]
    in_view = (np.abs(places[:, :2]) < np.array([0.75, 0.45]) * places[:, 2:]).all(axis=1)
    shown = places[in_view & (rng.uniform(size=len(places)) < share)][:most]
    strangers = rng.uniform((-1, -0.6, 1.2), (1, 0.6, 1.8), (len(shown) // 10, 3))
    both = np.concatenate((shown, strangers))
    noisy = both + rng.normal(size=both.shape) * SIGMA_M
    return FruitCloud(positions=noisy, covariances=np.tile(np.diag(SIGMA_M**2), (len(both), 1, 1)))


def step_to(found: Array, true: Array) -> Array:
    """Give the step from a pose to the true one, (6,): metres, radians, in the camera's frame."""
    off = np.linalg.solve(found, true)
    return np.concatenate((off[:3, 3], Rotation.from_matrix(off[:3, :3]).as_rotvec()))
