"""Places that the camera comes back to: some frames' fruits found among those of frames long before.

The fruits of a few neighbouring frames are looked for among all that were seen before them and are out of sight since,
by their constellations alone: where drift says the camera is, does not matter, nor from which side it looks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pomona.answer import Verdict
from pomona.cloud import FruitCloud
from pomona.survey.slam.constellation_links import LEAST_FRUITS, Constellations

__all__ = ["TOGETHER", "Loop", "SeenMap", "joined", "loop_at", "loops", "recognised"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

TOGETHER = 6
"""Neighbouring frames whose fruits are looked for together."""

SAME_PLACE_M = 0.1
"""Nearer than this no two trees stand that are copies of each other: it is one tree, whose fruits were not told as
the same from frame to frame."""

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

    def often(self, fruits: Rows) -> Rows:
        """Leave out fruits that hardly any frame saw, unless there is but one."""
        views = np.bincount(self.fruits, minlength=len(self.centres))
        return fruits[views[fruits] >= min(LEAST_VIEWS, len(self.poses))]

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

    def renamed(self, row_of: Rows, row_of_second: Rows | None = None) -> Loop:
        """Name frames by other rows, those of the later side by rows of their own where they are of another part."""
        sides = row_of, row_of if row_of_second is None else row_of_second
        pairs = self.pairs.copy()
        for side, rows in enumerate(sides):
            pairs[:, side, 0] = rows[pairs[:, side, 0]]
        return replace(self, first=int(sides[0][self.first]), second=int(sides[1][self.second]), pairs=pairs)


def loops(seen: SeenMap, constellations: Constellations) -> Iterator[Loop]:
    """Look for what was seen before, stretch by stretch."""
    for begin in range(0, len(seen.poses), TOGETHER):
        if (loop := loop_at(seen, constellations, begin)) is not None:
            yield loop


def loop_at(seen: SeenMap, constellations: Constellations, begin: int) -> Loop | None:
    """Look for what the stretch that begins with a frame saw among what was seen before, and went out of sight."""
    end = min(begin + TOGETHER, len(seen.poses))
    # What never left the sight is no place come back to.
    before = np.setdiff1d(seen.seen_in(0, begin - TOGETHER), seen.seen_in(begin - TOGETHER, end))
    loop = _Known(seen, before, constellations).stretch(seen, begin)
    return loop if isinstance(loop, Loop) else None


def recognised(there: SeenMap, seen: SeenMap, begins: Iterable[int], constellations: Constellations) -> Loop | None:
    """Look for what a stretch of one part saw anywhere in another; frames by their rows in their parts.

    Stretches begin with the frames given; the first that is found counts.
    """
    known = _Known(there, np.arange(len(there.centres)), constellations)
    for begin in begins:
        found = known.stretch(seen, begin)
        if found is not None:
            # Where one stretch fits in several ways, another that does not may have the right way out of sight.
            return found if isinstance(found, Loop) else None
    return None


class _Known:
    """Some of the fruits of a part, in which stretches are looked for."""

    def __init__(self, there: SeenMap, fruits: Rows, constellations: Constellations) -> None:
        self._constellations = constellations
        self._there, self._fruits = there, there.often(fruits)
        enough = len(self._fruits) >= LEAST_FRUITS
        self._map = constellations.of(there.cloud(self._fruits, np.eye(4))) if enough else None

    def stretch(self, seen: SeenMap, begin: int) -> Loop | Literal[Verdict.AMBIGUOUS] | None:
        """Look for the fruits of a stretch, as its middle frame sees them; say so where they fit in several ways."""
        end = min(begin + TOGETHER, len(seen.poses))
        here, second = seen.often(seen.seen_in(begin, end)), (begin + end) // 2
        if self._map is None or len(here) < LEAST_FRUITS:
            return None
        found = self._map.locate(seen.cloud(here, seen.poses[second]))
        if found.map_from_camera is None:
            return Verdict.AMBIGUOUS if found.status is Verdict.AMBIGUOUS else None
        there, known = self._there, self._fruits[found.pairs[:, 1]]
        if there is not seen and (
            repeats(there, known, self._constellations) or repeats(seen, here[found.pairs[:, 0]], self._constellations)
        ):
            return Verdict.AMBIGUOUS
        # Of the earlier frames, the one that saw the most of them holds the loop.
        saw = np.isin(there.fruits, known) & ((there.frames < second) | (there is not seen))
        first = int(np.bincount(there.frames[saw]).argmax())
        step = np.linalg.inv(there.poses[first]) @ found.map_from_camera
        pairs = np.stack((there.sightings_of(known), seen.sightings_of(here[found.pairs[:, 0]])), axis=1)
        return Loop(first, second, step, np.asarray(np.linalg.inv(found.covariance), np.float64), pairs)


def repeats(seen: SeenMap, fruits: Rows, constellations: Constellations) -> bool:
    """Say whether some fruits of a part, or a half of them, look like what stands elsewhere in it.

    Halves, because fruits of two trees that are copies of each other stand nowhere else together.
    """
    return any(_elsewhere(seen, piece, constellations) for piece in (fruits, *_halves(seen.centres, fruits)))


def _halves(centres: Array, fruits: Rows) -> tuple[Rows, Rows]:
    """Cut some fruits in two where they reach farthest."""
    from_middle = centres[fruits] - centres[fruits].mean(axis=0)
    along = from_middle @ np.linalg.svd(from_middle, full_matrices=False)[2][0]
    order = np.argsort(along, kind="stable")
    return fruits[order[: len(fruits) // 2]], fruits[order[len(fruits) // 2 :]]


def _elsewhere(seen: SeenMap, fruits: Rows, constellations: Constellations) -> bool:
    others = np.setdiff1d(np.arange(len(seen.centres)), fruits)
    if min(len(others), len(fruits)) < LEAST_FRUITS:
        return False
    found = constellations.of(seen.cloud(others, np.eye(4))).locate(seen.cloud(fruits, np.eye(4)))
    if found.map_from_camera is None:
        return found.status is Verdict.AMBIGUOUS
    same = seen.centres[np.stack((fruits[found.pairs[:, 0]], others[found.pairs[:, 1]]))]
    return bool(np.median(np.linalg.norm(same[1] - same[0], axis=1)) > SAME_PLACE_M)


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
    same = there[found.pairs[:, 1]], here[found.pairs[:, 0]]
    if any(repeats(part, fruits, constellations) for part, fruits in zip((before, after), same, strict=True)):
        return None
    pairs = np.stack(
        (before.sightings_of(there[found.pairs[:, 1]]), after.sightings_of(here[found.pairs[:, 0]])), axis=1
    )
    information = np.asarray(np.linalg.inv(found.covariance), np.float64)
    return Loop(last, 0, found.map_from_camera, information, pairs)
