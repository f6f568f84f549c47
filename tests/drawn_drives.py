"""Drives along drawn rows, and what odometry and cameras tell of them."""

import numpy as np
from scipy.spatial.transform import Rotation

from pomona import FruitCloud
from pomona.survey.refinement import Motions

SIGMAS = np.array([0.02, 0.02, 0.03, 0.004, 0.004, 0.004])


def exp(step: np.ndarray) -> np.ndarray:
    moved = np.eye(4)
    moved[:3, :3], moved[:3, 3] = Rotation.from_rotvec(step[3:]).as_matrix(), step[:3]
    return moved


def log(pose: np.ndarray) -> np.ndarray:
    return np.concatenate([pose[:3, 3], Rotation.from_matrix(pose[:3, :3]).as_rotvec()])


def drawn_drive(rng: np.random.Generator, n: int) -> np.ndarray:
    """A camera that goes round in a circle and wobbles."""
    turn = exp(np.array([0.3, 0.0, 0.05, 0.0, 2 * np.pi / n, 0.0]))
    poses = [np.eye(4)]
    for _ in range(n - 1):
        poses.append(poses[-1] @ turn @ exp(rng.normal(0, 0.01, 6)))
    return np.array(poses)


def measured(rng: np.random.Generator, true: np.ndarray, pairs: list[tuple[int, int]], doubtful: bool) -> Motions:
    first, second = np.array(pairs, np.int64).T
    noise = [exp(SIGMAS * rng.normal(size=6)) for _ in pairs]
    return Motions(
        first=first,
        second=second,
        first_from_second=np.linalg.inv(true[first]) @ true[second] @ np.array(noise),
        information=np.tile(np.diag(SIGMAS**-2.0), (len(pairs), 1, 1)),
        doubtful=np.full(len(pairs), doubtful),
    )


def neighbours(n: int) -> list[tuple[int, int]]:
    return [(row, row + 1) for row in range(n - 1)]


def drawn_row(rng: np.random.Generator, length_m: float) -> np.ndarray:
    """Fruits in clusters of up to three: x along the row, y down, z into it."""
    spurs = rng.uniform([-1.0, -0.8, -0.25], [length_m + 1, 0.8, 0.25], (int(28 * length_m), 3))
    fruits = np.repeat(spurs, rng.integers(1, 4, len(spurs)), axis=0)
    return fruits + rng.normal(0, 0.05, fruits.shape)


def seen(rng: np.random.Generator, fruits: np.ndarray, pose: np.ndarray) -> FruitCloud:
    """What a camera sees of them: a part is hidden, and depth is poorer than direction."""
    places = (fruits - pose[:3, 3]) @ pose[:3, :3]
    inside = (
        (places[:, 2] > 0.5) & (np.abs(places[:, 0]) < 0.7 * places[:, 2]) & (np.abs(places[:, 1]) < 0.5 * places[:, 2])
    )
    places = places[inside & (rng.uniform(size=len(places)) < 0.8)]
    sigmas = np.array([0.003, 0.003, 0.008])
    covariances = np.tile(np.diag(sigmas**2), (len(places), 1, 1))
    return FruitCloud(positions=places + sigmas * rng.normal(size=places.shape), covariances=covariances)


def facing(x_m: float, beyond: bool = False) -> np.ndarray:
    """A camera 1.5 m from the row; beyond it, it looks back."""
    pose = np.eye(4)
    pose[:3, 3] = [x_m, 0.0, 1.5 if beyond else -1.5]
    if beyond:
        pose[:3, :3] = np.diag([-1.0, 1.0, -1.0])
    return pose


def wobbling(rng: np.random.Generator, poses: list[np.ndarray]) -> np.ndarray:
    return np.array([pose @ exp(np.array([0.02] * 3 + [0.01] * 3) * rng.normal(size=6)) for pose in poses])
