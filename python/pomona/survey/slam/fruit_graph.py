"""The graph of one part of a way: poses of cameras and fruits, held by sightings and odometry.

Links and sightings say the same: a link is what two frames' sightings have in common. So links, and loops, only lay the
graph out and say who is who; what is minimised in the end are the sightings of the fruits, each once, and odometry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.survey.refinement import Motions, SeenFruits, refine
from pomona.survey.slam.anchors import Anchors, anchored
from pomona.survey.slam.consistency import BELIEVED2, NO_FRUITS, explained
from pomona.survey.slam.constellation_links import ConstellationLink, once
from pomona.survey.slam.identities_of_links import joined_fruits, linked_fruits
from pomona.survey.slam.loops import Loop, SeenMap

__all__ = ["FruitGraph", "sightings_of"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

OWN_M = 0.005
"""What the middle of a fruit seems to move by as it is seen from elsewhere, beyond what its depth says."""


class FruitGraph:
    """Frames that hang together.

    Parameters
    ----------
    clouds : sequence of FruitCloud
        What each frame saw, in the frame of its camera.
    motions : Motions
        Of odometry, between these frames.
    poses : (F, 4, 4) float64
        To begin with.

    Attributes
    ----------
    poses, covariances
        As `FruitWay` has them.
    links : list of ConstellationLink
        Those that are believed.
    """

    def __init__(self, clouds: Sequence[FruitCloud], motions: Motions, poses: Array) -> None:
        self._sightings, self._motions = sightings_of(clouds), motions
        self._begins = np.searchsorted(self._sightings.frames, np.arange(len(clouds)))
        self.links: list[ConstellationLink] = []
        self.poses = poses
        self.covariances = np.zeros((len(clouds), 6, 6))

    def link(self, links: Sequence[ConstellationLink]) -> SeenMap:
        """Adjust to links of frames; those that are believed say which sightings are of one fruit.

        Returns
        -------
        SeenMap
            The fruits where they are then.
        """
        motions = self._motions.and_those(once(links, len(self.poses)))
        found = refine(self.poses, NO_FRUITS, motions)
        self.poses, errors2 = found.session_from_camera, found.motion_squared_errors[len(self._motions) :]
        self.links = [link for link, error2 in zip(links, errors2, strict=True) if error2 <= BELIEVED2]
        fruits = linked_fruits(self.links, self._begins, self._sightings.frames)
        return self._adjusted(replace(self._sightings, fruits=fruits))

    def close(self, found: Sequence[Loop]) -> list[Loop]:
        """Adjust to loops too; those that are believed, which are returned, join fruits."""
        if not found:
            return []
        motions = self._motions.and_those(once(self.links, len(self.poses)).trusted())
        rows, adjusted = explained(self.poses, motions, found)
        self.poses, believed = adjusted.session_from_camera, [found[row] for row in rows]
        same = np.concatenate([np.empty((0, 2, 2), np.int64), *(loop.pairs for loop in believed)])
        pairs = (self._begins[same[..., 0]] + same[..., 1]).tolist()
        fruits = joined_fruits(self._sightings.fruits, self._sightings.frames, pairs)
        self._adjusted(replace(self._sightings, fruits=fruits))
        return believed

    def anchor(self, anchors: Anchors) -> None:
        """Adjust to what is known from outside, in its frame of reference."""
        found = anchored(self.poses, self._sightings, self._motions, anchors)
        self.poses = found.session_from_camera
        if found.pose_covariances is not None:
            self.covariances = found.pose_covariances

    def _adjusted(self, sightings: SeenFruits) -> SeenMap:
        """Adjust poses and fruits to the sightings and odometry."""
        found = refine(self.poses, sightings, self._motions, with_pose_covariances=True)
        self._sightings, self.poses = sightings, found.session_from_camera
        if found.pose_covariances is not None:
            self.covariances = found.pose_covariances
        return SeenMap(self.poses, sightings.frames, sightings.fruits, found.centres, found.covariances)


def sightings_of(clouds: Sequence[FruitCloud]) -> SeenFruits:
    """Give all fruits of all frames, each a fruit of its own as long as no link says otherwise."""
    frames = np.repeat(np.arange(len(clouds)), [len(cloud) for cloud in clouds])
    centres = np.concatenate([np.empty((0, 3)), *(cloud.positions for cloud in clouds)])
    known = [cloud.covariances for cloud in clouds if cloud.covariances is not None]
    covariances = np.concatenate([np.empty((0, 3, 3)), *known]) + OWN_M**2 * np.eye(3)
    return SeenFruits(frames, np.arange(len(frames)), centres, covariances)
