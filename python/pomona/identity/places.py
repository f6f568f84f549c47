"""Where each fruit hung on the day of each visit, and whether the visit looked there, and from where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.identity.near_fruits import AskedPlaces, NearFruits
from pomona.identity.visits import SeenVisit, Sights

__all__ = [
    "Surroundings",
    "has_fruits_near",
    "looked_at_by_cameras",
    "on_days",
    "reaches_m",
    "surroundings_of",
    "towards_camera",
]

NEIGHBOURS = 3
"""A visit looked where so many of its fruits are near."""

NEAR = 1.5
"""As near as that many times what was when the fruit was seen: where every second fruit is gone, 1.3 times."""

AS_MOST = 0.98
"""Share of the visit's own fruits by which near, and straight before a camera, are measured."""

PENCIL = 24
"""Lines of sight that are laid together: the fruits of a few frames."""

LEAST_LENGTH = 1.5
"""Of a covariance along its first axis against the second, squared, by which it tells the line of sight."""

LEAST_LINES = 6


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What is around each fruit on the day of each visit.

    Attributes
    ----------
    places : (K, V, 3) float64
        Where the fruit hangs, metres.
    spacings_m : (K, V) float64
        How near the third of its neighbours was when it was seen.
    """

    places: NDArray[np.float64]
    spacings_m: NDArray[np.float64]


def surroundings_of(
    sights: Sights, labels: NDArray[np.int64], positions: NDArray[np.float64], fruits: Sequence[NearFruits]
) -> Surroundings:
    """Return the surroundings by the sight of each fruit that is nearest in order.

    `positions` are those of the sights, (S, 3); `fruits` the same, visit by visit.
    """
    spacings_m = np.concatenate([own.spacings_m(NEIGHBOURS + 1) for own in fruits])
    told = on_days(sights, labels)
    return Surroundings(positions[told], spacings_m[told])


def on_days(sights: Sights, labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the sight that tells of each fruit on each day, (K, V): the one nearest in order."""
    n_fruits, n_visits = int(labels.max(initial=-1)) + 1, len(sights.starts)
    seen = np.full((n_fruits, n_visits), -1)
    seen[labels, sights.visits] = np.arange(len(labels))
    told = seen.copy()
    for visit in range(n_visits):
        for other in sorted(range(n_visits), key=lambda other: (abs(other - visit), other)):
            told[:, visit] = np.where(told[:, visit] < 0, seen[:, other], told[:, visit])
    return told


def looked_at_by_cameras(visit: SeenVisit, asked: AskedPlaces) -> NDArray[np.bool_] | None:
    """Tell before which places, (K,), a camera came as straight, and as near, as before most fruits of the visit.

    Straight in the camera's x and y apart, as a picture is a rectangle: fruits high and low on a tree say how far a
    picture reaches up and down, and nothing of what lies beyond the end of a drive. None where the visit has no
    cameras, or they do not explain its own fruits.
    """
    if visit.cameras is None or not len(visit.cameras):
        return None
    straightest = _straightest(visit.cameras, asked.fruits.positions)
    farthest = np.quantile(straightest, AS_MOST, axis=1, method="lower")
    if not np.isfinite(farthest).all():
        return None
    return np.asarray((_straightest(visit.cameras, asked.places) <= farthest[:, None]).all(axis=0))


def reaches_m(own: NearFruits, spacings_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how near to each place, (K,), a visit that looked there has some of its fruits.

    As near as fruits were when that at the place was seen, (K,), or as the visit's fruits are to one another.
    """
    if len(own) <= NEIGHBOURS:
        return np.zeros(len(spacings_m))
    return np.maximum(np.quantile(own.spacings_m(NEIGHBOURS + 1), AS_MOST), NEAR * spacings_m)


def has_fruits_near(asked: AskedPlaces, reach_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell around which places, (K,), a visit has its fruits so near: there it looked, whatever is known of cameras."""
    if len(asked.fruits) <= NEIGHBOURS:
        return np.zeros(len(reach_m), bool)
    return np.asarray(asked.nearest[0][:, NEIGHBOURS - 1] <= reach_m)


def _straightest(cameras: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return |x| / z, |y| / z and z of each place in the camera that has it nearest to its axis, (3, K)."""
    least, best = np.full(len(places), np.inf), np.full((3, len(places)), np.inf)
    for camera in cameras:
        x, y, z = camera[:3, :3].T @ (places - camera[:3, 3]).T
        with np.errstate(divide="ignore", invalid="ignore"):
            across, along = np.abs(x) / z, np.abs(y) / z
        off_axis = np.where(z > 0, across**2 + along**2, np.inf)
        best = np.where(off_axis < least, (across, along, z), best)
        least = np.minimum(least, off_axis)
    return best


def towards_camera(visit: SeenVisit, asked: AskedPlaces, axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit vectors from places, (K, 3), to where a visit looked at them from; NaN where nothing tells.

    The camera nearest to the place; or where the lines of sight of the fruits around it meet, which are the long axes
    of their covariances. `axes` turns the visit's axes into those of the places, (3, 3).
    """
    towards: NDArray[np.float64]
    if visit.cameras is not None and len(visit.cameras):
        from scipy.spatial import cKDTree

        stations = visit.cameras[:, :3, 3]
        towards = stations[cKDTree(stations).query(asked.places)[1]] - asked.places
    else:
        towards = _meeting_points(visit.covariances, asked, axes) - asked.places
    with np.errstate(invalid="ignore"):
        return np.asarray(towards / np.linalg.norm(towards, axis=1, keepdims=True))


def _meeting_points(
    covariances: NDArray[np.float64] | None, asked: AskedPlaces, axes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the points nearest to the lines of sight around each place: sum of (1 - d d') (c - x) is zero."""
    nowhere = np.full(asked.places.shape, np.nan)
    if covariances is None:
        return nowhere
    lengths, vectors = np.linalg.eigh(covariances)
    tell = np.flatnonzero(lengths[:, 2] > LEAST_LENGTH * lengths[:, 1])
    if len(tell) < LEAST_LINES:
        return nowhere
    lines, own = vectors[tell, :, 2] @ axes.T, asked.fruits.positions[tell]
    across = np.eye(3) - lines[:, :, None] * lines[:, None, :]
    of_lines = np.concatenate([across.reshape(-1, 9), np.einsum("nij,nj->ni", across, own)], axis=1)
    all_tell = len(tell) == len(asked.fruits)
    nearest = asked.nearest[1][:, :PENCIL] if all_tell else NearFruits(own).nearest(asked.places, PENCIL)[1]
    sums = _sums_of_rows(of_lines, nearest)
    weights, moments = sums[:, :9].reshape(-1, 3, 3), sums[:, 9:]
    # Lines that are all parallel meet nowhere; the little weight of the place itself keeps the sum solvable.
    little = 1e-6
    solved = np.linalg.solve(weights + little * np.eye(3), (moments + little * asked.places)[:, :, None])
    return np.asarray(solved[:, :, 0])


def _sums_of_rows(values: NDArray[np.float64], rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return sums of some rows of values, (K, n), for each of K: as a product with ones nothing is laid out for it."""
    from scipy.sparse import csr_array

    ends = np.arange(0, rows.size + 1, rows.shape[1])
    return np.asarray(csr_array((np.ones(rows.size), rows.ravel(), ends), (len(rows), len(values))) @ values)
