"""Where one part of a drive lies beside another one, by the fruits that both saw and the way that the camera went.

The fruits at the end of one part and at the begin of the next are few, and their depths poor: most were seen once. So a
pose is judged by the covariances: with S the sum of those of two places, d apart, the pair gains

    ln N(d; 0, S) - ln rho,    rho the density of the fruits,

where that is positive, and the pose the largest sum over pairs, one to one. Poses are tried along the camera's last
direction, each settled by Gauss and Newton's steps on its pairs (Cauchy's loss).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

__all__ = ["Fruits", "Registered", "registered"]

Array = NDArray[np.float64]

STEP_M, FARTHEST_M = 0.05, 2.5
"""Distances along the camera's direction that are tried: half of what a step settles; what an arm's length from a row
shows twice."""

PRIOR_M, PRIOR_RAD = 0.1, 0.035
"""How far the camera leaves the straight line meanwhile: a hand's breadth and 2 degrees."""

PLACE_SIGMA_M = 0.01
"""What places differ by beyond their covariances: fruits are no spheres, and are seen from elsewhere."""

REACH_M = 0.4
"""Farther apart, two places are not weighed: poor depths err by less."""

STEPS = 6

SURE_NATS = 40.0
"""Least gain: on `rendered_row` wrong poses gain up to 25, true ones 50 and more."""

SURE_PAIRS = 8

MARGIN_NATS, ELSEWHERE_M = 15.0, 0.2
"""By how much any pose that is so far away must gain less."""


@dataclass(frozen=True, eq=False)
class Fruits:
    """Places (N, 3) with covariances (N, 3, 3), metres."""

    places: Array
    covariances: Array

    def moved(self, pose: Array) -> Fruits:
        """Give them in another frame of reference."""
        turn = pose[:3, :3]
        return Fruits(self.places @ turn.T + pose[:3, 3], turn @ self.covariances @ turn.T)


@dataclass(frozen=True, eq=False)
class Registered:
    """A pose `before_from_part`, what it gains, and its pairs."""

    before_from_part: Array
    nats: float
    pairs: int


def registered(before: Fruits, part: Fruits, last: Array, step: Array, first: Array) -> Array | None:
    """Find `before_from_part`, None where the fruits do not tell it.

    Parameters
    ----------
    before, part : Fruits
        Those near the end of one part, and near the begin of the next, in their frames of reference.
    last, first : (4, 4)
        Poses of the last camera of the one and the first camera of the other.
    step : (3,)
        Last motion of the camera, in its own frame.
    """
    length_m = float(np.linalg.norm(step))
    if length_m == 0.0 or not len(before.places) or not len(part.places):
        return None
    found = []
    for way_m in np.arange(0.0, FARTHEST_M, STEP_M):
        ahead = np.eye(4)
        ahead[:3, 3] = step * (way_m / length_m)
        found.append(_settled(before, part, last @ ahead @ np.linalg.inv(first)))
    best = max(found, key=lambda one: one.nats)
    place = (best.before_from_part @ first)[:3, 3]
    apart_m = [float(np.linalg.norm((one.before_from_part @ first)[:3, 3] - place)) for one in found]
    rival = max((one.nats for one, m in zip(found, apart_m, strict=True) if m > ELSEWHERE_M), default=0.0)
    is_sure = best.nats > max(SURE_NATS, rival + MARGIN_NATS) and best.pairs >= SURE_PAIRS
    return best.before_from_part if is_sure else None


def _settled(before: Fruits, part: Fruits, start: Array) -> Registered:
    pose = start
    for _ in range(STEPS):
        rows, columns, nats = _pairs(before, part.moved(pose))
        if len(rows) < 3:
            return Registered(pose, nats, len(rows))
        pose = _stepped(before, part.moved(pose), (rows, columns), pose, start)
    rows, _, nats = _pairs(before, part.moved(pose))
    return Registered(pose, nats, len(rows))


def _pairs(before: Fruits, part: Fruits) -> tuple[NDArray[np.intp], NDArray[np.intp], float]:
    """Rows of the pairs that gain most together, and what they gain."""
    rows, columns = np.nonzero(
        np.linalg.norm(before.places[:, None] - part.places[None], axis=2) < REACH_M,
    )
    gains = np.zeros((len(before.places), len(part.places)))
    apart, spread = _apart(before, part, rows, columns)
    squares = np.einsum("ni,nij,nj->n", apart, np.linalg.inv(spread), apart)
    log_densities = -0.5 * (squares + np.linalg.slogdet(2 * np.pi * spread)[1])
    volume_m3 = float(np.prod(np.maximum(np.ptp(before.places, axis=0), REACH_M)))
    gains[rows, columns] = np.maximum(log_densities - np.log(len(before.places) / volume_m3), 0.0)
    rows, columns = linear_sum_assignment(-gains)
    gained = gains[rows, columns]
    return rows[gained > 0], columns[gained > 0], float(gained.sum())


def _apart(before: Fruits, part: Fruits, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> tuple[Array, Array]:
    spread = before.covariances[rows] + part.covariances[columns] + PLACE_SIGMA_M**2 * np.eye(3)
    return before.places[rows] - part.places[columns], spread


def _stepped(
    before: Fruits, part: Fruits, pairs: tuple[NDArray[np.intp], NDArray[np.intp]], pose: Array, start: Array
) -> Array:
    """Give the pose after one step (translation, rotation about the part's origin) towards the pairs."""
    apart, spread = _apart(before, part, *pairs)
    weights = np.linalg.inv(spread)
    weights /= 1 + np.einsum("ni,nij,nj->n", apart, weights, apart)[:, None, None] / 3
    arms = part.places[pairs[1]] - pose[:3, 3]
    slopes = np.zeros((len(arms), 3, 6))
    slopes[:, :, :3] = np.eye(3)
    slopes[:, [0, 1, 2], [4, 5, 3]] = arms[:, [2, 0, 1]]
    slopes[:, [0, 1, 2], [5, 3, 4]] = -arms[:, [1, 2, 0]]
    prior = np.diag([PRIOR_M**-2] * 3 + [PRIOR_RAD**-2] * 3)
    left = pose[:3, :3] @ start[:3, :3].T
    strayed = np.concatenate([pose[:3, 3] - start[:3, 3], Rotation.from_matrix(left).as_rotvec()])
    matrix = np.einsum("nij,nik,nkl->jl", slopes, weights, slopes) + prior
    step = np.linalg.solve(matrix, np.einsum("nij,nik,nk->j", slopes, weights, apart) - prior @ strayed)
    result = pose.copy()
    result[:3, 3] += step[:3]
    result[:3, :3] = Rotation.from_rotvec(step[3:]).as_matrix() @ pose[:3, :3]
    return result
