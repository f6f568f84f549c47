"""Fewer poses for the refinement of a recording that sees the same fruits again and again.

Poses that see one fruit are connected, and eliminating a pose costs the square of how many it is connected with. A row
driven once connects a pose with a dozen others, however long it is. Driven to and fro many times it connects each with
hundreds, and a recording of hours would never end. Then every k-th pose is adjusted, and those between follow the
corrections of their neighbours: k divides both the poses and the connections, so the cost falls with its cube.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pomona.survey.refinement import Motions

__all__ = ["between_keys", "followed", "stride"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

MAX_COST = 4e6
"""Sum of squared connections that is adjusted whole: a few seconds; 15,000 frames of a row driven once."""


def stride(rows: Rows, fruits: Rows, n_frames: int) -> int:
    """Every how manyth pose to adjust.

    Parameters
    ----------
    rows, fruits : (S,) int64
        Frame and fruit of each sighting.
    n_frames : int
        Frames of the part.
    """
    if not len(rows):
        return 1
    views = np.bincount(fruits)
    connections = np.zeros(n_frames)
    np.maximum.at(connections, rows, views[fruits])
    cost = float((connections**2).sum())
    return max(1, math.ceil(math.cbrt(cost / MAX_COST)))


def between_keys(poses: Array, motions: Motions, keys: Rows) -> Motions:
    """Give the motions from each key to the next.

    Their covariances are sums of those of the frames between. What a frame's rotation errs by moves all that follow:
    over a way of length L that is a third of L^2 times its variance.

    Parameters
    ----------
    poses : (F, 4, 4) float64
        As odometry has them.
    motions : Motions
        Between frames.
    keys : (K,) int64
        Rows of the frames that are kept, ascending.
    """
    step = np.zeros((len(poses), 6, 6))
    spans = np.maximum(motions.second - motions.first, 1)[:, None, None]
    step[motions.second] = np.linalg.inv(motions.information) / spans
    summed = np.concatenate([np.zeros((1, 6, 6)), np.cumsum(step, axis=0)])
    first, second = np.arange(len(keys) - 1), np.arange(1, len(keys))
    first_from_second = np.linalg.inv(poses[keys[:-1]]) @ poses[keys[1:]]
    covariances = summed[keys[1:] + 1] - summed[keys[:-1] + 1]
    length2 = (first_from_second[:, :3, 3] ** 2).sum(axis=1)
    turning = np.trace(covariances[:, 3:, 3:], axis1=1, axis2=2) / 3
    covariances[:, :3, :3] += (length2 * turning / 3)[:, None, None] * np.eye(3)
    return Motions(first, second, first_from_second, np.linalg.inv(covariances))


def followed(poses: Array, keys: Rows, refined: Array) -> Array:
    """Move all poses as their neighbouring keys were moved.

    Parameters
    ----------
    poses : (F, 4, 4) float64
        As odometry has them.
    keys : (K,) int64
        Rows of the keys, ascending, the first and the last frame among them.
    refined : (K, 4, 4) float64
        Poses of the keys.

    Returns
    -------
    (F, 4, 4) float64
        Between two keys the correction, in the frame of the camera, goes evenly from the one's to the other's.
    """
    from scipy.spatial.transform import Rotation, Slerp

    if len(keys) == 1:
        return refined
    corrections = np.linalg.inv(poses[keys]) @ refined
    rows = np.arange(len(poses))
    moved = np.tile(np.eye(4), (len(poses), 1, 1))
    moved[:, :3, :3] = Slerp(keys, Rotation.from_matrix(corrections[:, :3, :3]))(rows).as_matrix()
    for axis in range(3):
        moved[:, axis, 3] = np.interp(rows, keys, corrections[:, axis, 3])
    return np.asarray(poses @ moved)
