"""Where each visit looked and how well it saw what is there: what leaves hide from one side stays hidden."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.identity.near_fruits import AskedPlaces, NearFruits
from pomona.identity.places import looked_at, surroundings_of, towards_camera
from pomona.identity.visits import SeenVisit, Sights

__all__ = ["Looks", "looks_of", "quantile_of_rows", "visibility_classes"]

SAME_SIDE = 0.5
"""Cosine of the angle between two looks at a fruit, 60 degrees, under which one tells of the other."""

AROUND = 25
"""Fruits with which the views of one are compared: those that as many frames could see."""

MOST_VIEWS = 0.85
"""Quantile of their views that is all views."""

SHARES_OF_VIEWS = np.array([0.02, 0.05, 0.10, 0.15, 0.22, 0.30, 0.42, 0.55, 0.70])
"""Between the classes of fruits by how well the looks before saw them, as ranks in the visit. Fine where they are
small: a fruit that one look of five saw and one that one of two saw are far from alike."""


@dataclass(frozen=True, eq=False)
class Looks:
    """What each visit saw of each fruit and where it looked.

    Attributes
    ----------
    seen, in_view : (K, V) bool
        Whether the visit saw the fruit, and whether it looked where it hangs.
    views : (K, V) float64
        How well it saw it: rank in the visit, 0 to 1, by the views that a fruit there can have; 0 where it did not.
    towards : (K, V, 3) float64
        From the fruit to the camera; NaN where unknown.
    """

    seen: NDArray[np.bool_]
    in_view: NDArray[np.bool_]
    views: NDArray[np.float64]
    towards: NDArray[np.float64]


def looks_of(
    visits: Sequence[SeenVisit],
    sights: Sights,
    labels: NDArray[np.int64],
    positions: NDArray[np.float64],
    frames: NDArray[np.float64],
) -> Looks:
    """Find out where each visit looked; `positions`, (S, 3), and `frames`, (V, 4, 4), are in and into the map."""
    fruits = [NearFruits(own) for own in np.split(positions, sights.starts[1:])]
    around = surroundings_of(sights, labels, positions, fruits)
    places = around.places
    seen = np.zeros(places.shape[:2], bool)
    seen[labels, sights.visits] = True
    in_view, views, towards = seen.copy(), np.zeros(seen.shape), np.full(places.shape, np.nan)
    for number, visit in enumerate(visits):
        own = np.flatnonzero(sights.visits == number)
        if not len(own):
            continue
        rows = np.full(len(places), -1)
        rows[labels[own]] = np.arange(len(own))
        asked = AskedPlaces(places[:, number], fruits[number], rows)
        scale = np.cbrt(np.linalg.det(frames[number, :3, :3]))
        in_map = _with_cameras_in_map(visit, frames[number], scale)
        in_view[:, number] |= looked_at(in_map, asked, around.spacings_m[:, number])
        towards[:, number] = towards_camera(in_map, asked, frames[number, :3, :3] / scale)
        views[labels[own], number] = _shares_of_views(visit.n_views, fruits[number])
    return Looks(seen, in_view, views, towards)


def _with_cameras_in_map(visit: SeenVisit, map_from_visit: NDArray[np.float64], scale: float) -> SeenVisit:
    from dataclasses import replace

    if visit.cameras is None:
        return visit
    cameras = map_from_visit @ visit.cameras
    cameras[:, :3, :3] /= scale
    return replace(visit, cameras=cameras)


def _shares_of_views(n_views: NDArray[np.int64] | None, fruits: NearFruits) -> NDArray[np.float64]:
    """Return ranks, 0 to 1, of the views of each fruit against those around it; the middle where nobody counted."""
    if n_views is None:
        return np.full(len(fruits), 0.5)
    possible = np.maximum(quantile_of_rows(n_views[fruits.rows(AROUND)], MOST_VIEWS), 1.0)
    return _ranks(n_views / possible) / len(fruits)


def quantile_of_rows(counts: NDArray[np.int64], share: float) -> NDArray[np.float64]:
    """Return a quantile of each row, as `np.quantile` does at six times the cost."""
    place = (counts.shape[1] - 1) * share
    low = int(place)
    high = min(low + 1, counts.shape[1] - 1)
    ordered = np.partition(counts, (low, high), axis=1)
    least, most = ordered[:, low].astype(np.float64), ordered[:, high]
    part = place - low
    return np.asarray(least + (most - least) * part if part < 0.5 else most - (most - least) * (1.0 - part))


def _ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the place of each value in order, from 1; equal ones share the middle of theirs."""
    _, which, counts = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(counts) - 0.5 * (counts - 1))[which])


def visibility_classes(looks: Looks) -> NDArray[np.int64]:
    """Return how well each fruit can be seen on each visit, by what the visits before that looked from its side saw.

    Returns
    -------
    (K, V) int64
        0 where none has; else 1 and more, the place of the mean of `Looks.views` among `SHARES_OF_VIEWS`.
    """
    n_fruits, n_visits = looks.seen.shape
    classes = np.zeros((n_fruits, n_visits), np.int64)
    for visit in range(n_visits):
        views, looks_before = np.zeros(n_fruits), np.zeros(n_fruits)
        for before in range(visit):
            cosines = np.einsum("ki,ki->k", looks.towards[:, before], looks.towards[:, visit])
            # What is not known is NaN, and counts as the same side.
            tells = looks.in_view[:, before] & ~(cosines < SAME_SIDE)
            views += np.where(tells, looks.views[:, before], 0.0)
            looks_before += tells
        shares = views / np.maximum(looks_before, 1.0)
        known = 1 + np.searchsorted(SHARES_OF_VIEWS, shares, side="right")
        classes[:, visit] = np.where(looks_before > 0, known, 0)
    return classes
