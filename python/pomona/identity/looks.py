"""Where each visit looked and how well it saw what is there: what leaves hide from one side stays hidden."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.identity.local_shares import fruits_about
from pomona.identity.near_fruits import AskedPlaces, NearFruits
from pomona.identity.places import (
    has_fruits_near,
    looked_at_by_cameras,
    reaches_m,
    surroundings_of,
    towards_camera,
)
from pomona.identity.stretches import FoundAround, emptied_stretches, went_by
from pomona.identity.visits import SeenVisit, Sights

__all__ = ["Looks", "looks_of", "quantile_of_rows", "visibility_classes"]

SAME_SIDE = 0.5
"""Cosine of the angle between two looks at a fruit, 60 degrees, under which one tells of the other."""

AROUND = 25
"""Fruits with which the views of one are compared: those that as many frames could see."""

MOST_VIEWS = 0.85
"""Quantile of their views that is all views."""

MISSES = 5
"""So many looks that all missed a fruit are told apart."""

SHARES_OF_VIEWS = np.array([0.0035, 0.008, 0.015, 0.03, 0.05, 0.10, 0.15, 0.22, 0.30, 0.42, 0.55, 0.70])
"""Between the classes of fruits by how well the looks before saw them, as ranks in the visit. Fine where they are
small: a fruit that one look of five saw and one that one of two saw are far from alike."""

USUAL_VIEWS = 0.4
"""Mean of the views of a fruit that every look saw where nobody counts frames; of one that some saw that times the
square of their share, as those that leaves hide are seen worse, too."""


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
    is_counted : (V,) bool
        Whether the visit counts the frames that saw each fruit.
    emptied : (K, V) float64
        Probability that the visit came by, and what hung about the fruit had been taken.
    went_by : (K, V) bool
        Whether the visit went by there for sure, and did not end before.
    about : (K, n) int64
        The fruits around it, as `fruits_about`.
    """

    seen: NDArray[np.bool_]
    in_view: NDArray[np.bool_]
    views: NDArray[np.float64]
    towards: NDArray[np.float64]
    is_counted: NDArray[np.bool_]
    emptied: NDArray[np.float64]
    went_by: NDArray[np.bool_]
    about: NDArray[np.int64]

    @classmethod
    def of_seasons(cls, seasons: Sequence[Looks]) -> Looks:
        """Put seasons one after the other: none of them looked at the fruits of another."""
        n_fruits, n_visits = np.sum([one.seen.shape for one in seasons], axis=0).tolist()
        seen, in_view, by = np.zeros((3, n_fruits, n_visits), bool)
        views, emptied = np.zeros((2, n_fruits, n_visits))
        towards = np.full((n_fruits, n_visits, 3), np.nan)
        n_about = min(one.about.shape[1] for one in seasons)
        about, fruit, visit = [], 0, 0
        for one in seasons:
            of = np.s_[fruit : fruit + one.seen.shape[0], visit : visit + one.seen.shape[1]]
            seen[of], in_view[of], by[of] = one.seen, one.in_view, one.went_by
            views[of], emptied[of], towards[of] = one.views, one.emptied, one.towards
            about.append(one.about[:, :n_about] + fruit)
            fruit, visit = of[0].stop, of[1].stop
        is_counted = np.concatenate([one.is_counted for one in seasons])
        return cls(seen, in_view, views, towards, is_counted, emptied, by, np.concatenate(about))


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
    found = []
    for number, visit in enumerate(visits):
        own = np.flatnonzero(sights.visits == number)
        reach_m = reaches_m(fruits[number], around.spacings_m[:, number])
        if not len(own):
            found.append(FoundAround(fruits[number].positions, places[:, number], reach_m, seen[:, number], False))
            continue
        rows = np.full(len(places), -1)
        rows[labels[own]] = np.arange(len(own))
        asked = AskedPlaces(places[:, number], fruits[number], rows)
        scale = np.cbrt(np.linalg.det(frames[number, :3, :3]))
        in_map = _with_cameras_in_map(visit, frames[number], scale)
        is_near = has_fruits_near(asked, reach_m)
        by_cameras = looked_at_by_cameras(in_map, asked)
        found.append(FoundAround(fruits[number].positions, places[:, number], reach_m, is_near, by_cameras is None))
        # Beyond its last fruits along the row what a visit missed says nothing: it may have ended.
        in_view[:, number] |= is_near & went_by(found[-1], 1) if by_cameras is None else by_cameras
        towards[:, number] = towards_camera(in_map, asked, frames[number, :3, :3] / scale)
        views[labels[own], number] = _shares_of_views(visit.n_views, fruits[number])
    is_counted = np.array([visit.n_views is not None for visit in visits], bool)
    passed = np.stack([went_by(visit) for visit in found], axis=1)
    emptied, about = emptied_stretches(found, seen, sights.days), fruits_about(places[:, -1])
    return Looks(seen, in_view, views, towards, is_counted, emptied, passed, about)


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


def visibility_classes(looks: Looks) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return how well each fruit can be seen on each visit, by what the visits before that looked from its side saw.

    Returns
    -------
    (K, V) int64
        The number of looks that all missed it, to `MISSES`; else more than that by the place of the mean of
        `Looks.views` among `SHARES_OF_VIEWS`; and so once more for those that some looks missed and others saw.
    (K, V) int64
        The same where all have missed it.
    """
    classes, unseen = np.zeros(looks.seen.shape, np.int64), np.zeros(looks.seen.shape, np.int64)
    for visit in range(looks.seen.shape[1]):
        # What is not known is NaN, and counts as the same side.
        cosines = np.einsum("kvi,ki->kv", looks.towards[:, :visit], looks.towards[:, visit])
        tells = looks.in_view[:, :visit] & ~(cosines < SAME_SIDE)
        n_looks = tells.sum(axis=1)
        unseen[:, visit] = np.minimum(n_looks, MISSES)
        views = _views_so_far(looks, tells) / np.maximum(n_looks, 1)
        in_part = (tells & ~looks.seen[:, :visit]).any(axis=1)
        known = 1 + MISSES + np.searchsorted(SHARES_OF_VIEWS, views, side="right")
        known += in_part * (len(SHARES_OF_VIEWS) + 1)
        classes[:, visit] = np.where(views > 0.0, known, unseen[:, visit])
    return classes, unseen


def _views_so_far(looks: Looks, tells: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the sum of the views of each fruit, (K,), over the looks that tell of it."""
    until = tells.shape[1]
    is_counted = looks.is_counted[:until]
    counted = np.where(tells & is_counted, looks.views[:, :until], 0.0).sum(axis=1)
    uncounted = (tells & ~is_counted).sum(axis=1)
    n_seen = (tells & ~is_counted & looks.seen[:, :until]).sum(axis=1)
    return np.asarray(counted + USUAL_VIEWS * n_seen**2 / np.maximum(uncounted, 1))
