"""Places that the camera comes back to: some frames' fruits found among those of frames long before.

The fruits of a few neighbouring frames are looked for among all that were seen before them and are out of sight since,
by their constellations alone: where drift says the camera is, does not matter, nor from which side it looks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.survey.slam.constellation_links import LEAST_FRUITS, Constellations

__all__ = ["Loop", "SeenMap", "joined", "loops"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

TOGETHER = 6
"""Neighbouring frames whose fruits are looked for together."""

LEAST_VIEWS = 2
"""Of a fruit that is looked for, or looked at: what one frame saw alone is often nothing."""


@dataclass(frozen=True, eq=False)
class SeenMap:
    """Fruits as the poses so far place them.

    Attributes
    ----------
    poses : (F, 4, 4) float64
        `session_from_camera`.
    frames, fruits : (S,) int64
        Frame and fruit of each sighting.
    centres : (N, 3) float64
        Of the fruits, in the session.
    covariances : (N, 3, 3) float64
    """

    poses: Array
    frames: Rows
    fruits: Rows
    centres: Array
    covariances: Array

    def seen_in(self, first: int, end: int) -> Rows:
        """Give the fruits that the frames of a range saw."""
        return np.unique(self.fruits[(self.frames >= first) & (self.frames < end)])

    def sightings_of(self, fruits: Rows) -> Rows:
        """Give the frame and the row in it of the first sighting of each fruit, (..., 2)."""
        first = np.unique(self.fruits, return_index=True)[1][fruits]
        frames = self.frames[first]
        return np.stack((frames, first - np.searchsorted(self.frames, frames)), axis=-1)

    def cloud(self, fruits: Rows, pose: Array) -> FruitCloud:
        """Give fruits in the frame of a camera."""
        turn = pose[:3, :3]
        return FruitCloud(
            positions=(self.centres[fruits] - pose[:3, 3]) @ turn, covariances=turn.T @ self.covariances[fruits] @ turn
        )


@dataclass(frozen=True, eq=False)
class Loop:
    """A frame found from an earlier one.

    Attributes
    ----------
    first, second : int
        Rows of the frames.
    first_from_second : (4, 4) float64
    information : (6, 6) float64
        As in `ConstellationLink`.
    pairs : (M, 2, 2) int64
        Of each fruit that is the same: frame and row in it of a sighting of the earlier and of the later one.
    """

    first: int
    second: int
    first_from_second: Array
    information: Array
    pairs: Rows


def loops(seen: SeenMap, constellations: Constellations) -> Iterator[Loop]:
    """Look for what was seen before, stretch by stretch."""
    views = np.bincount(seen.fruits, minlength=len(seen.centres))
    often = views >= LEAST_VIEWS
    for begin in range(2 * TOGETHER, len(seen.poses), TOGETHER):
        end = min(begin + TOGETHER, len(seen.poses))
        here, before = seen.seen_in(begin, end), seen.seen_in(0, begin - TOGETHER)
        # What never left the sight is no place come back to.
        before = np.setdiff1d(before, seen.seen_in(begin - TOGETHER, end))
        here, before = here[often[here]], before[often[before]]
        if min(len(here), len(before)) >= LEAST_FRUITS:
            yield from _found(seen, constellations, (begin + end) // 2, here, before)


def _found(seen: SeenMap, constellations: Constellations, second: int, here: Rows, before: Rows) -> Iterator[Loop]:
    found = constellations.of(seen.cloud(before, np.eye(4))).locate(seen.cloud(here, seen.poses[second]))
    if not found or found.map_from_camera is None:
        return
    fruits = np.stack((before[found.pairs[:, 1]], here[found.pairs[:, 0]]), axis=1)
    # Of the earlier frames, the one that saw the most of them holds the loop.
    saw = np.isin(seen.fruits, fruits[:, 0]) & (seen.frames < second)
    first = int(np.bincount(seen.frames[saw]).argmax())
    step = np.linalg.inv(seen.poses[first]) @ found.map_from_camera
    yield Loop(first, second, step, np.asarray(np.linalg.inv(found.covariance), np.float64), seen.sightings_of(fruits))


def joined(before: SeenMap, after: SeenMap, constellations: Constellations) -> Loop | None:
    """Look for what the first frames of a part saw in what the last ones of an earlier part did.

    Returns
    -------
    Loop or None
        From the last frame of the one to the first of the other, each frame by its row in its own part.
    """
    last = len(before.poses) - 1
    there, here = before.seen_in(last + 1 - TOGETHER, last + 1), after.seen_in(0, TOGETHER)
    if min(len(there), len(here)) < LEAST_FRUITS:
        return None
    map = constellations.of(before.cloud(there, before.poses[last]), neighbours=True)
    found = map.locate(after.cloud(here, after.poses[0]))
    if not found or found.map_from_camera is None:
        return None
    pairs = np.stack(
        (before.sightings_of(there[found.pairs[:, 1]]), after.sightings_of(here[found.pairs[:, 0]])), axis=1
    )
    information = np.asarray(np.linalg.inv(found.covariance), np.float64)
    return Loop(last, 0, found.map_from_camera, information, pairs)
