"""The way while it is gone: each frame has its place as it comes, and loops close where they are found.

A frame takes its place by the surest of what ties it to frames before, of those that agree. Every few frames the last
ones are adjusted together with their fruits, and what they saw is looked for in all that went out of sight before, in
parts that broke off too. What that moves is adjusted at once; all else waits for `FruitSlam.way`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.arrays import definite_matrices, rigid_motions
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.survey.refinement import Motions
from pomona.survey.slam.anchors import Anchors
from pomona.survey.slam.consistency import explained, explains
from pomona.survey.slam.constellation_links import ConstellationLink, Constellations, linked, motions_of, once
from pomona.survey.slam.fruit_graph import sightings_of
from pomona.survey.slam.fruit_way import FruitWay, Known, adjusted_way, require_anchors, require_clouds
from pomona.survey.slam.identities_of_links import joined_fruits, pairs_of
from pomona.survey.slam.loops import TOGETHER, Loop, SeenMap, loop_at, recognised
from pomona.survey.slam.odometry_errors import OdometryErrors, learnt_errors
from pomona.survey.slam.placing import placings

__all__ = ["FruitSlam", "PlacedFrame"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

LAST = 4 * TOGETHER
"""Frames that are adjusted together as they come: some more than see a fruit."""


@dataclass(frozen=True, eq=False)
class PlacedFrame:
    """Where a frame is.

    Attributes
    ----------
    part : int
        Number of the part that the frame is in; a frame that hangs together with none before begins one, and so does
        one of which as many ties say one thing as say another.
    session_from_camera : (4, 4) float64
        In the frame of reference of the part.
    closed : bool
        Whether the way was found to come back here, or two parts to be one: earlier frames may lie elsewhere now.
    """

    part: int
    session_from_camera: Array
    closed: bool


class FruitSlam:
    """A way by fruits that grows frame by frame; `way` gives what `way_by_fruits` does of the frames so far.

    Parameters
    ----------
    config : mapping, optional
        Values of the core's tables that differ from `pomona.default_config()`.
    threads : int, optional
        As in `pomona.Localizer`.
    """

    def __init__(self, *, config: Mapping[str, Any] | None = None, threads: int | None = None) -> None:
        self._constellations = Constellations((), config=config, threads=threads)
        self._told = Motions.none()
        self._errors = OdometryErrors()
        self._links: list[ConstellationLink] = []
        self._believed: list[ConstellationLink] = []
        self._loops: list[Loop] = []
        self._parts = np.zeros(0, np.int64)
        self._poses = np.zeros((0, 4, 4))
        self._begins = np.zeros(1, np.int64)
        self._fruits = np.zeros(0, np.int64)
        self._settled = 0

    def __len__(self) -> int:
        return len(self._parts)

    def __repr__(self) -> str:
        return f"FruitSlam({len(self)} frames in {len(np.unique(self._parts))} parts, {len(self._loops)} loops)"

    @property
    def parts(self) -> Rows:
        """Part of each frame so far, (F,)."""
        return self._parts.copy()

    @property
    def session_from_camera(self) -> Array:
        """Poses of all frames so far, (F, 4, 4), each in the frame of reference of its part."""
        return self._poses.copy()

    def add(
        self,
        cloud: FruitCloud,
        moved: Array | None = None,
        information: Array | None = None,
        *,
        doubtful: bool = True,
    ) -> PlacedFrame:
        """Place the next frame.

        Parameters
        ----------
        cloud : FruitCloud
            What it saw, in the frame of its camera, metres, with covariances.
        moved : (4, 4) float64, optional
            Its pose in the frame of the camera before, as odometry measured it.
        information : (6, 6) float64
            Inverse covariance of `moved`, of a step (translation, rotation) in the frame of this camera.
        doubtful : bool
            Whether `moved` may be wrong, altogether, as of wheels that slip, or steadily, as of wheels of another size
            than is thought: links outvote such a motion, and how far motions are off is learnt from them. Else it is
            trusted as far as its information says.

        Raises
        ------
        PomonaError
            The cloud has no covariances or some that are beyond numbers, `moved` is not rigid or `information` not
            positive definite, or only one of them is given. The frame is not counted then.
        """
        require_clouds([cloud])
        motion = _checked_motion(len(self), moved, information, doubtful=doubtful)
        row = len(self)
        with self._constellations.adding(cloud):
            links = list(linked(self._constellations, row))
        self._links += links
        ties = motions_of(links)
        if row:
            self._told, ties = self._told.and_those(motion), self._errors.mended(motion).and_those(ties)
        united = self._place(ties)
        self._begins = np.append(self._begins, self._begins[-1] + len(cloud))
        self._fruits = np.append(self._fruits, self._fruits.max(initial=-1) + 1 + np.arange(len(cloud)))
        closed = len(self) - self._settled == TOGETHER and self._settle()
        return PlacedFrame(int(self._parts[-1]), self._poses[-1].copy(), united or closed)

    def way(self, anchors: Anchors | None = None) -> FruitWay:
        """Adjust all frames so far to each other, and to what is known from outside."""
        require_anchors(anchors, len(self))
        return adjusted_way(Known(self._constellations, self._told, anchors, self._links, []))

    def _place(self, ties: Motions) -> bool:
        """Put the frame where its ties agree; parts that they tie together are one from now on: say whether."""
        here = placings(self._parts, self._poses, ties)
        part, pose = here[0] if here else (self._parts.max(initial=-1) + 1, np.eye(4))
        self._parts, self._poses = np.append(self._parts, part), np.concatenate([self._poses, pose[None]])
        for other in here[1:]:
            self._unite(other.part, other.pose, len(self) - 1)
        return len(here) > 1

    def _unite(self, part: int, in_part: Array, row: int) -> None:
        """Say that a frame of another part has a pose in this one; the later part goes on in the earlier."""
        other = int(self._parts[row])
        part_from_other = in_part @ np.linalg.inv(self._poses[row])
        if other < part:
            part, other, part_from_other = other, part, self._poses[row] @ np.linalg.inv(in_part)
        rows = self._parts == other
        self._poses[rows] = part_from_other @ self._poses[rows]
        self._parts[rows] = part

    def _settle(self) -> bool:
        """Adjust the last frames, say who is who in them, and look whether they were here before."""
        begin, self._settled = self._settled, len(self)
        self._errors = learnt_errors(self._told, self._links)
        known = Known(self._constellations, self._errors.mended(self._told), None, self._links, [])
        for part in np.unique(self._parts[begin:]).tolist():
            rows = self._rows_of(part)[-LAST:]
            graph, _ = known.graph(rows, self._poses)
            self._poses[rows] = graph.poses
            links = [link for link in (link.renamed(rows) for link in graph.links) if link.second >= begin]
            self._believed += links
            self._same(pairs_of(links, self._begins))
        return self._came_back(begin) or self._goes_on()

    def _came_back(self, begin: int) -> bool:
        """Look whether the last frames see what was out of sight."""
        rows = self._rows_of(int(self._parts[-1]))
        seen = self._seen(rows)
        loop = loop_at(seen, self._constellations, int(np.searchsorted(rows, begin)))
        if loop is None:
            return False
        if not explains(seen.poses, loop):
            # Too far from where the frames lie: perhaps they have drifted.
            believed, adjusted = explained(seen.poses, self._ties(rows), [loop])
            if not believed:
                return False
            self._poses[rows] = adjusted.session_from_camera
        self._close(loop.renamed(rows))
        return True

    def _goes_on(self) -> bool:
        """Look whether the last frames see what a part before did."""
        rows = self._rows_of(int(self._parts[-1]))
        seen, last = self._seen(rows), max(len(rows) - TOGETHER, 0)
        for part in np.unique(self._parts[self._parts < self._parts[-1]]).tolist():
            there = self._rows_of(part)
            join = recognised(self._seen(there), seen, [last], self._constellations)
            if join is not None:
                join = join.renamed(there, rows)
                self._unite(part, self._poses[join.first] @ join.first_from_second, join.second)
                self._close(join)
                return True
        return False

    def _close(self, loop: Loop) -> None:
        self._loops.append(loop)
        self._same((self._begins[loop.pairs[..., 0]] + loop.pairs[..., 1]).tolist())

    def _same(self, pairs: list[tuple[int, int]]) -> None:
        """Join the fruits of pairs of sightings."""
        self._fruits = joined_fruits(self._fruits, self._frames(), pairs)

    def _frames(self) -> Rows:
        """Frame of each sighting, (S,)."""
        return np.repeat(np.arange(len(self)), np.diff(self._begins))

    def _rows_of(self, part: int) -> Rows:
        return np.flatnonzero(self._parts == part)

    def _ties(self, rows: Rows) -> Motions:
        """Give what is believed of the frames of a part."""
        row_of = np.full(len(self), -1, np.int64)
        row_of[rows] = np.arange(len(rows))
        links = [link.renamed(row_of) for link in self._believed if row_of[link.second] >= 0]
        closed = [loop.renamed(row_of) for loop in self._loops if row_of[loop.second] >= 0]
        known = self._errors.mended(self._told.inside(row_of)).and_those(once(links, len(rows)).trusted())
        return known.and_those(motions_of(closed).trusted())

    def _seen(self, rows: Rows) -> SeenMap:
        """Fruits of a part where its poses have them: the mean of all sightings, weighted by what each knows."""
        clouds = [self._constellations.cloud(row) for row in rows.tolist()]
        seen = sightings_of(clouds)
        named = np.concatenate(
            [np.zeros(0, np.int64), *(self._fruits[slice(*self._begins[row : row + 2])] for row in rows)]
        )
        fruits = np.unique(named, return_inverse=True)[1]
        poses = self._poses[rows]
        turns, places = poses[seen.frames, :3, :3], poses[seen.frames, :3, 3]
        known = np.linalg.inv(turns @ seen.covariances @ turns.transpose(0, 2, 1))
        weighted = known @ (turns @ seen.centres_in_camera[..., None] + places[..., None])
        summed = np.zeros((2, fruits.max(initial=-1) + 1, 3, 3))
        np.add.at(summed[0], fruits, known)
        np.add.at(summed[1, ..., :1], fruits, weighted)
        covariances = np.linalg.inv(summed[0])
        return SeenMap(poses, seen.frames, fruits, (covariances @ summed[1, ..., :1])[..., 0], covariances)


def _checked_motion(row: int, moved: Array | None, information: Array | None, *, doubtful: bool) -> Motions:
    """Give the motion to a frame from the one before, or none."""
    if moved is None and information is None:
        return Motions.none()
    if moved is None or information is None:
        raise PomonaError("moved, information: found one of them, expected both or none")
    if not isinstance(doubtful, bool | np.bool_):
        raise PomonaError(f"doubtful: found {type(doubtful).__name__}, expected True or False")
    return Motions(
        np.array([row - 1]),
        np.array([row]),
        rigid_motions("moved", moved)[None],
        definite_matrices("information", information, (6, 6))[None],
        np.array([doubtful]),
    )
