"""Which fruits of a part hang in a row behind the one that is scanned: the detector takes large ones for its fruits.

Fruits that hang together, each near to the next, are a stand: a row, or some of its trees. Between rows is an alley,
where nothing hangs, so no stand has fruits of both; where a few strays hang there all the same, two layers that are
clearly apart are two stands. A stand is behind where the frames that come near to its fruits
show a row an alley nearer to the camera's way. So it does not matter how a row bends, from how far or from which sides
it is filmed, or what stands behind where a tree is missing; a row that the camera passes elsewhere is judged there.
`docs/tracking.md` has the equations and figures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.survey.farther_layer import farther_layer

__all__ = ["nearest_m", "rows_behind"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

ALLEY_M = 1.0
"""Least way through between the fruits of two rows: nobody drives through less."""

SPACINGS = 3.0
"""Median distances from a fruit to the next that are no alley either: where few fruits hang, they hang far apart."""

ROW_SHARE = 1 / 3
"""Of the fruits a metre of what is behind, from which on those before are a row, and not leaves taken for fruits."""

STRAYS = 0.1
"""Of the fruits of a layer, those that may hang less than an alley from the layer before it."""

NEAREST_M = 0.1
"""Nearer to the way of the camera no fruit is seen."""


def rows_behind(centres: Array, frames: Rows, fruits: Rows, session_from_camera: Array) -> NDArray[np.bool_]:
    """Tell which fruits hang behind the row that is scanned, (N,).

    Parameters
    ----------
    centres : (N, 3) float64
        Of the fruits, in the session, metres.
    frames, fruits : (S,) int64
        Sightings, in order of frames: row of the pose, row of the fruit. Every fruit has one.
    session_from_camera : (F, 4, 4) float64
        Poses.
    """
    away_m = _from_way(centres, frames, fruits, session_from_camera[:, :3, 3])
    least_m = _least(fruits, away_m, len(centres))
    stands = _in_layers(_stands(centres), centres, least_m)
    balance = np.zeros(stands.max(initial=0) + 1)
    is_near = away_m < least_m[fruits] + ALLEY_M
    for rows in np.split(np.arange(len(frames)), np.flatnonzero(np.diff(frames)) + 1):
        shown, places = np.unique(stands[fruits[rows]], return_inverse=True)
        balance[shown] += np.bincount(places, weights=is_near[rows]) * _more_before(places, away_m[rows])
    return np.asarray(balance > 0)[stands]


def _more_before(stands: Rows, away_m: Array) -> Array:
    """Tell of each stand that a frame shows how many more fruits a metre hang before it than make a row there.

    Parameters
    ----------
    stands : (V,) int64
        Stand of each fruit in the frame, from 0 without gaps.
    away_m : (V,) float64
        How far each is from the camera's way.
    """
    # Of a row at twice the distance a picture shows twice as many metres.
    per_metre = np.bincount(stands, weights=1 / away_m)
    near_m = np.full(len(per_metre), np.inf)
    np.minimum.at(near_m, stands, away_m)
    is_before = (near_m < near_m[:, None] - ALLEY_M).astype(np.float64)
    before: Array = is_before @ per_metre
    return before - ROW_SHARE * per_metre


def _from_way(centres: Array, frames: Rows, fruits: Rows, cameras: Array) -> Array:
    """Give how far from the camera's way each sighting's fruit is, (S,): across it, for what is ahead is not behind.

    `cameras` (F, 3) are the places of all frames. Where the camera stands there is no way, and the distance is that
    from the camera.
    """
    gone_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(cameras, axis=0), axis=1))])
    ahead, back = (
        np.stack([np.interp(gone_m + step_m, gone_m, places) for places in cameras.T], axis=1)
        for step_m in (ALLEY_M / 2, -ALLEY_M / 2)
    )
    way = ahead - back
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), ALLEY_M / 2)
    towards = centres[fruits] - cameras[frames]
    across = towards - np.einsum("si,si->s", towards, way[frames])[:, None] * way[frames]
    return np.asarray(np.maximum(np.linalg.norm(across, axis=1), NEAREST_M), np.float64)


def _stands(centres: Array) -> Rows:
    """Say in which stand each fruit is, (N,), from 0."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    n = len(centres)
    if n < 2:
        return np.zeros(n, np.int64)
    tree = cKDTree(centres)
    to_next_m = np.asarray(tree.query(centres, k=[2])[0])
    pairs = tree.query_pairs(max(ALLEY_M, SPACINGS * float(np.median(to_next_m))), output_type="ndarray")
    near = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    return np.asarray(connected_components(near, directed=False)[1], np.int64)


def _in_layers(stands: Rows, centres: Array, least_m: Array) -> Rows:
    """Part the stands whose fruits, so far from the camera's way, are in two layers but for a few strays."""
    from scipy.spatial import cKDTree

    parted = 2 * stands
    for stand in range(stands.max(initial=-1) + 1):
        rows = np.flatnonzero(stands == stand)
        is_far = farther_layer(least_m[rows])
        if is_far.any():
            across_m = np.asarray(cKDTree(centres[rows[~is_far]]).query(centres[rows[is_far]])[0])
            # Trees at the end of a row that the camera saw from far alone have the others of the row beside them.
            parted[rows] += is_far & bool((across_m < ALLEY_M).mean() <= STRAYS)
    return np.asarray(np.unique(parted, return_inverse=True)[1], np.int64)


def nearest_m(centres: Array, frames: Rows, fruits: Rows, session_from_camera: Array) -> Array:
    """Give how near the camera's way came to each fruit while it was seen, (N,); arguments as of `rows_behind`."""
    return _least(fruits, _from_way(centres, frames, fruits, session_from_camera[:, :3, 3]), len(centres))


def _least(fruits: Rows, away_m: Array, n: int) -> Array:
    """Give the least of the distances of the sightings, (S,), of each of `n` fruits."""
    least_m = np.full(n, np.inf)
    np.minimum.at(least_m, fruits, away_m)
    return least_m
