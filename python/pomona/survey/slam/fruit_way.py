"""The story of a way by fruits: frames -> links -> graph of poses -> fruits -> loops -> poses and fruits together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.survey.refinement import Motions
from pomona.survey.slam.anchors import Anchors
from pomona.survey.slam.constellation_links import ConstellationLink, Constellations, chained, motions_of
from pomona.survey.slam.fruit_graph import FruitGraph
from pomona.survey.slam.loops import TOGETHER, Loop, SeenMap, joined, loops, recognised
from pomona.survey.slam.odometry_errors import learnt_errors
from pomona.survey.slam.spanning import spanned_poses

__all__ = ["FruitWay", "Known", "adjusted_way", "require_anchors", "require_clouds", "way_by_fruits"]

Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False, repr=False)
class FruitWay:
    """Where the camera was in each frame.

    Attributes
    ----------
    parts : (F,) int64
        Number of the part that each frame is in, from 0: frames that hang together.
    session_from_camera : (F, 4, 4) float64
        In the frame of reference of its part, the camera of the part's first frame.
    covariances : (F, 6, 6) float64
        Of a step (translation, rotation) of each pose in its own frame, the first pose of its part being sure.
    links : tuple of ConstellationLink
        Frames found in frames just before.
        Those that are believed.
    refused : int
        Other links, which these contradict.
    loops : tuple of Loop
        Places come back to, those that are believed.
    refused_loops : int
    """

    parts: NDArray[np.int64]
    session_from_camera: NDArray[np.float64]
    covariances: NDArray[np.float64]
    links: tuple[ConstellationLink, ...]
    refused: int
    loops: tuple[Loop, ...]
    refused_loops: int

    def __len__(self) -> int:
        return len(self.parts)

    def __repr__(self) -> str:
        n_parts = len(np.unique(self.parts))
        return f"FruitWay({len(self)} frames in {n_parts} parts, {len(self.links)} links, {len(self.loops)} loops)"


def way_by_fruits(
    clouds: Iterable[FruitCloud],
    motions: Motions | None = None,
    *,
    anchors: Anchors | None = None,
    config: Mapping[str, Any] | None = None,
    threads: int | None = None,
) -> FruitWay:
    """Find the camera's way past some fruits.

    Parameters
    ----------
    clouds : iterable of FruitCloud
        What each frame saw, in the frame of its camera, metres, with covariances; in order of time.
    motions : Motions, optional
        What was measured between the frames otherwise, by odometry.
    anchors : Anchors, optional
        Places by GNSS, verticals by an IMU. Parts with a place, or a vertical, are in the frame of the anchors then.
    config : mapping, optional
        Values of the core's tables that differ from `pomona.default_config()`.
    threads : int, optional
        As in `pomona.Localizer`.

    Raises
    ------
    PomonaError
        A cloud is none or has no covariances, a motion or an anchor is of no frame, or a setting is wrong. Frames that
        hang together with no other are parts of one frame.
    """
    if isinstance(clouds, FruitCloud) or not isinstance(clouds, Iterable):
        raise PomonaError(f"clouds: found {type(clouds).__name__}, expected a FruitCloud of each frame")
    if not isinstance(motions, Motions | None):
        raise PomonaError(f"motions: found {type(motions).__name__}, expected Motions")
    clouds = list(clouds)
    require_clouds(clouds)
    motions = Motions.none() if motions is None else motions.checked(len(clouds))
    require_anchors(anchors, len(clouds))
    constellations = Constellations(clouds, config=config, threads=threads)
    return adjusted_way(Known(constellations, motions, anchors, chained(constellations), []))


def adjusted_way(known: Known) -> FruitWay:
    """Lay out what is known of the frames, join parts, close loops, and adjust it all."""
    known = replace(known, motions=learnt_errors(known.motions, known.links).mended(known.motions))
    parts, start = known.laid_out()
    # Parts that were joined have seen more together, by which others join them.
    tried: set[tuple[int, ...]] = set()
    while joins := list(_joins(known, parts, start, tried)):
        known = replace(known, joins=[*known.joins, *joins])
        parts, start = known.laid_out()
    n = len(known.constellations)
    way = FruitWay(parts, start, np.zeros((n, 6, 6)), (), len(known.links), (), 0)
    for rows in _rows_of(parts):
        way = _with_part(way, rows, known)
    return way


@dataclass(frozen=True, eq=False)
class Known:
    """All that is known of how frames lie to each other, by the rows of the recording or of a part."""

    constellations: Constellations
    motions: Motions
    anchors: Anchors | None
    links: list[ConstellationLink]
    joins: list[Loop]

    def laid_out(self) -> tuple[Rows, NDArray[np.float64]]:
        """Give the part of each frame, and poses to begin with."""
        doubtful = motions_of([*self.links, *self.joins])
        return spanned_poses(self.motions.and_those(doubtful), len(self.constellations))

    def graph(self, rows: Rows, poses: NDArray[np.float64]) -> tuple[FruitGraph, SeenMap]:
        """Adjust the frames of a part to each other."""
        row_of = _row_of(rows, len(self.constellations))
        clouds = [self.constellations.cloud(row) for row in rows.tolist()]
        graph = FruitGraph(clouds, self.motions.inside(row_of), poses[rows])
        return graph, graph.link(
            [link.renamed(row_of) for link in self.links if min(row_of[link.first], row_of[link.second]) >= 0]
        )


def _joins(known: Known, parts: Rows, start: NDArray[np.float64], tried: set[tuple[int, ...]]) -> Iterator[Loop]:
    """Look for the beginning of each part where one of the two before ended, else for any of it anywhere before.

    Parts of which each has the frames that it had when they were tried are not tried again.
    """
    rows = _rows_of(parts)
    maps = [known.graph(ours, start)[1] for ours in rows] if len(rows) > 1 else []
    names = [(int(ours[0]), len(ours)) for ours in rows]
    for second in range(1, len(maps)):
        before = [first for first in range(second - 1, -1, -1) if (*names[first], *names[second]) not in tried]
        tried |= {(*names[first], *names[second]) for first in before}
        just_before = [first for first in before if first >= second - 2]
        begins = range(0, len(rows[second]), TOGETHER)
        ends = ((first, joined(maps[first], maps[second], known.constellations)) for first in just_before)
        anywhere = ((first, recognised(maps[first], maps[second], begins, known.constellations)) for first in before)
        for first, join in chain(ends, anywhere):
            if join is not None:
                yield join.renamed(rows[first], rows[second])
                break


def _with_part(way: FruitWay, rows: Rows, known: Known) -> FruitWay:
    """Adjust one part of a way; rows of a part are those of its frames, in order."""
    row_of = _row_of(rows, len(way))
    graph, seen = known.graph(rows, way.session_from_camera)
    found = [join.renamed(row_of) for join in known.joins if row_of[join.first] >= 0]
    n_joins = len(found)
    found += loops(seen, known.constellations)
    believed = graph.close(found)
    if known.anchors is not None and len(here := known.anchors.inside(row_of)):
        graph.anchor(here)
    poses, covariances = way.session_from_camera.copy(), way.covariances.copy()
    poses[rows], covariances[rows] = graph.poses, graph.covariances
    closed = [loop for loop in found[n_joins:] if loop in believed]
    return FruitWay(
        parts=way.parts,
        session_from_camera=poses,
        covariances=covariances,
        links=(*way.links, *(link.renamed(rows) for link in graph.links)),
        refused=way.refused - len(graph.links),
        loops=(*way.loops, *(loop.renamed(rows) for loop in closed)),
        refused_loops=way.refused_loops + len(found) - n_joins - len(closed),
    )


def _rows_of(parts: Rows) -> list[Rows]:
    return [np.flatnonzero(parts == part) for part in range(int(parts.max(initial=-1)) + 1)]


def _row_of(rows: Rows, n_frames: int) -> Rows:
    row_of = np.full(n_frames, -1, np.int64)
    row_of[rows] = np.arange(len(rows))
    return row_of


def require_clouds(clouds: Sequence[FruitCloud]) -> None:
    """Refuse what are no fruits, and fruits of which it is not known how well they are placed."""
    for row, cloud in enumerate(clouds):
        if not isinstance(cloud, FruitCloud):
            raise PomonaError(f"clouds: found {type(cloud).__name__}, expected a FruitCloud of each frame")
        if len(cloud) and cloud.covariances is None:
            raise PomonaError(f"clouds: frame {row} has no covariances, expected those of every fruit")


def require_anchors(anchors: Anchors | None, n_frames: int) -> None:
    """Refuse anchors of frames that there are not."""
    rows = np.zeros(0, np.int64) if anchors is None else np.concatenate([anchors.frames, anchors.upright_frames])
    if len(wrong := rows[(rows < 0) | (rows >= n_frames)]):
        raise PomonaError(f"anchors: found frame {wrong[0]}, expected one of 0 to {n_frames - 1}")
