"""Places of fruits out of the directions in which many pictures show them.

The place X of a fruit minimises sum_k c^2/2 ln(1 + m_k^2/c^2) over its boxes k, m_k^2 being the squared distance of the
box's direction from that of X in units of the box's sigma: Cauchy's loss, as in the core's `bundle`, because a box
around half a fruit is off by more than Gaussian noise. Gauss and Newton's steps on reweighted equations, all at once.
The covariance is the inverse of the last equations, times the mean m_k^2 where the boxes agree worse than they say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.triangulation.posed_boxes import PosedBoxes, PosedPictures

__all__ = ["ManyViews", "meeting_points", "projected", "triangulated"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

SCALE2 = 5.7
"""Cauchy's c^2: 5 % of what Gaussian noise would let one know is lost (Holland and Welsch, 1977)."""

STEPS = 12
"""Of Gauss and Newton; three are enough from a good start."""


@dataclass(frozen=True, eq=False)
class ManyViews:
    """Fruits out of many views.

    Attributes
    ----------
    positions : (N, 3) float64
        In the model, NaN where the directions do not meet.
    covariances : (N, 3, 3) float64
        Of the positions while the poses stay.
    squared_errors : (S,) float64
        m_k^2 of each sight.
    """

    positions: Array
    covariances: Array
    squared_errors: Array


def projected(in_camera: Array) -> tuple[Array, Array]:
    """Give x and y over z of places in a camera, (..., 2), and their slopes, (..., 2, 3)."""
    x, y, z = np.moveaxis(in_camera, -1, 0)
    z = np.where(np.abs(z) < np.finfo(np.float64).tiny, np.finfo(np.float64).tiny, z)
    nothing = np.zeros_like(z)
    slopes = np.stack([np.stack([1 / z, nothing, -x / z**2], -1), np.stack([nothing, 1 / z, -y / z**2], -1)], -2)
    return np.stack([x / z, y / z], -1), slopes


def triangulated(pictures: PosedPictures, boxes: PosedBoxes, rows: Rows, fruits: Rows, starts: Array) -> ManyViews:
    """Find the places of fruits.

    Parameters
    ----------
    pictures, boxes
        Where they were taken, and what they show.
    rows, fruits : (S,) int64
        Row of the box and of the fruit of each sight.
    starts : (N, 3) float64
        Where to begin.
    """
    positions = np.array(starts, np.float64)
    for _ in range(STEPS):
        errors, slopes = _residuals(pictures, boxes, rows, positions[fruits])
        weights = 1 / (1 + (errors**2).sum(axis=1) / SCALE2)
        normal, right = _equations(errors, slopes, weights, fruits, len(positions))
        positions = positions - np.linalg.solve(normal, right[..., None])[..., 0]
    errors, slopes = _residuals(pictures, boxes, rows, positions[fruits])
    squared = (errors**2).sum(axis=1)
    normal, _ = _equations(errors, slopes, 1 / (1 + squared / SCALE2), fruits, len(positions))
    covariances = np.linalg.inv(normal) * _excess(squared, fruits, len(positions))[:, None, None]
    behind = pictures.in_cameras(positions[fruits], boxes.pictures[rows])[:, 2] <= 0
    positions[np.bincount(fruits, behind, len(positions)) > 0] = np.nan
    return ManyViews(positions, covariances, squared)


def meeting_points(pictures: PosedPictures, boxes: PosedBoxes, rows: Rows, fruits: Rows, n_fruits: int) -> Array:
    """Give the points nearest to the rays of each fruit, (N, 3), where to begin."""
    of = boxes.pictures[rows]
    rays = np.einsum(
        "sji,sj->si", pictures.rotations[of], np.pad(boxes.directions[rows], ((0, 0), (0, 1)), constant_values=1)
    )
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    normal, right = np.zeros((n_fruits, 3, 3)), np.zeros((n_fruits, 3))
    np.add.at(normal, fruits, across)
    np.add.at(right, fruits, np.einsum("sij,sj->si", across, pictures.centres[of]))
    normal += 1e-12 * np.eye(3)
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0])


def _residuals(pictures: PosedPictures, boxes: PosedBoxes, rows: Rows, places: Array) -> tuple[Array, Array]:
    of = boxes.pictures[rows]
    seen, slopes = projected(pictures.in_cameras(places, of))
    sigmas = boxes.sigmas[rows]
    in_model = slopes @ pictures.rotations[of]
    return (seen - boxes.directions[rows]) / sigmas[:, None], in_model / sigmas[:, None, None]


def _equations(errors: Array, slopes: Array, weights: Array, fruits: Rows, n_fruits: int) -> tuple[Array, Array]:
    normal, right = np.zeros((n_fruits, 3, 3)), np.zeros((n_fruits, 3))
    np.add.at(normal, fruits, np.einsum("s,ski,skj->sij", weights, slopes, slopes))
    np.add.at(right, fruits, np.einsum("s,ski,sk->si", weights, slopes, errors))
    # A fruit of one direction is as far as anywhere: what is added only keeps the equations soluble.
    normal += 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(3) + 1e-12 * np.eye(3)
    return normal, right


def _excess(squared: Array, fruits: Rows, n_fruits: int) -> Array:
    """Give how much farther than they say the boxes of each fruit are off, at least 1: robust mean of m^2 over 2."""
    kept = np.minimum(squared, 2 * SCALE2)
    degrees = np.maximum(2 * np.bincount(fruits, minlength=n_fruits) - 3, 1)
    return np.maximum(1.0, np.bincount(fruits, kept, n_fruits) / degrees)
