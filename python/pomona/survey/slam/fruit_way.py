"""The story of a way by fruits: frames -> links -> graph of poses -> fruits -> loops -> poses and fruits together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.survey.refinement import Motions
from pomona.survey.slam.anchors import Anchors
from pomona.survey.slam.constellation_links import ConstellationLink, Constellations, chained, motions_of
from pomona.survey.slam.fruit_graph import FruitGraph
from pomona.survey.slam.loops import Loop, loops
from pomona.survey.slam.spanning import spanned_poses

__all__ = ["FruitWay", "way_by_fruits"]

Rows = NDArray[np.int64]

Found = TypeVar("Found", ConstellationLink, Loop)


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
    clouds: Sequence[FruitCloud],
    motions: Motions | None = None,
    *,
    anchors: Anchors | None = None,
    config: Mapping[str, Any] | None = None,
    threads: int | None = None,
) -> FruitWay:
    """Find the camera's way past some fruits.

    Parameters
    ----------
    clouds : sequence of FruitCloud
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
        A cloud has no covariances, or a setting is wrong. Frames that hang together with no other are parts of one
        frame.
    """
    _require_covariances(clouds)
    constellations = Constellations(clouds, config=config, threads=threads)
    links = chained(constellations)
    known = Motions.none() if motions is None else motions
    parts, start = spanned_poses(known.and_those(motions_of(links)), len(clouds))
    way = FruitWay(parts, start, np.zeros((len(clouds), 6, 6)), (), len(links), (), 0)
    for part in range(int(parts.max(initial=-1)) + 1):
        rows = np.flatnonzero(parts == part)
        if len(rows) > 1:
            way = _with_part(way, rows, constellations, links, (known, anchors))
    return way


def _with_part(
    way: FruitWay,
    rows: Rows,
    constellations: Constellations,
    links: Sequence[ConstellationLink],
    known: tuple[Motions, Anchors | None],
) -> FruitWay:
    """Adjust one part of a way; rows of a part are those of its frames, in order."""
    row_of = np.full(len(way), -1, np.int64)
    row_of[rows] = np.arange(len(rows))
    graph = FruitGraph(
        [constellations.cloud(row) for row in rows.tolist()], _inside(known[0], row_of), way.session_from_camera[rows]
    )
    ours = [_renamed(link, row_of) for link in links if row_of[link.first] >= 0]
    found = list(loops(graph.link(ours), constellations))
    believed = graph.close(found)
    if known[1] is not None and len(here := known[1].inside(row_of)):
        graph.anchor(here)
    poses, covariances = way.session_from_camera.copy(), way.covariances.copy()
    poses[rows], covariances[rows] = graph.poses, graph.covariances
    return FruitWay(
        parts=way.parts,
        session_from_camera=poses,
        covariances=covariances,
        links=(*way.links, *(_renamed(link, rows) for link in graph.links)),
        refused=way.refused - len(graph.links),
        loops=(*way.loops, *(_renamed(loop, rows) for loop in believed)),
        refused_loops=way.refused_loops + len(found) - len(believed),
    )


def _renamed(found: Found, row_of: Rows) -> Found:
    return replace(found, first=int(row_of[found.first]), second=int(row_of[found.second]))


def _inside(motions: Motions, row_of: Rows) -> Motions:
    kept = np.flatnonzero(row_of[motions.first] >= 0)
    return Motions(
        row_of[motions.first[kept]],
        row_of[motions.second[kept]],
        motions.first_from_second[kept],
        motions.information[kept],
        motions.which_are_doubtful()[kept],
    )


def _require_covariances(clouds: Sequence[FruitCloud]) -> None:
    bare = next((row for row, cloud in enumerate(clouds) if len(cloud) and cloud.covariances is None), None)
    if bare is not None:
        raise PomonaError(f"clouds: frame {bare} has no covariances, expected those of every fruit")
