"""Poses and fruits of a whole session, adjusted together.

Odometry drifts; fruits stay where they are. A fruit that is seen from many frames, and above all one that is seen again
later, holds these frames together, so the adjustment of all sightings and all relative motions is better than either
(`docs/odometry.md` has the equations and what it reaches).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.arrays import checked_array, definite_matrices, rigid_motions
from pomona.errors import PomonaError

__all__ = ["Motions", "Refined", "SeenFruits", "refine"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class SeenFruits:
    """Fruits seen in frames.

    Attributes
    ----------
    frames : (S,) int64
        Row of the frame in the poses.
    fruits : (S,) int64
        Row of the fruit, from 0 without gaps.
    centres_in_camera : (S, 3) float64
        Metres.
    covariances : (S, 3, 3) float64
        Of the centres, in the frame of the camera, positive definite, square metres.
    """

    frames: Rows
    fruits: Rows
    centres_in_camera: Array
    covariances: Array

    def __len__(self) -> int:
        return len(self.frames)


@dataclass(frozen=True, eq=False)
class Motions:
    """Relative poses of frames, as `pomona.odometry` measures them.

    Attributes
    ----------
    first, second : (M,) int64
        Rows of the frames.
    first_from_second : (M, 4, 4) float64
        Take points of the second camera into the first.
    information : (M, 6, 6) float64
        Inverse covariances of a step (translation, rotation) of the second camera in its own frame.
    doubtful : (M,) bool, optional
        Which may be wrong altogether, of a place that looks the same: Cauchy's loss lets them go. Else none may.
    """

    first: Rows
    second: Rows
    first_from_second: Array
    information: Array
    doubtful: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.first)

    @classmethod
    def none(cls) -> Motions:
        """Nothing measured: fruits alone say where the cameras are."""
        rows = np.zeros(0, np.int64)
        return cls(rows, rows, np.zeros((0, 4, 4)), np.zeros((0, 6, 6)))

    def and_those(self, other: Motions) -> Motions:
        """Take these and then others, between the same frames."""
        both = (self, other)
        return Motions(
            np.concatenate([one.first for one in both]),
            np.concatenate([one.second for one in both]),
            np.concatenate([one.first_from_second for one in both]),
            np.concatenate([one.information for one in both]),
            np.concatenate([one.which_are_doubtful() for one in both]),
        )

    def trusted(self) -> Motions:
        """Give the same, none of which may be wrong."""
        return Motions(self.first, self.second, self.first_from_second, self.information)

    def weakened(self, part: float) -> Motions:
        """Give the same with a part of their information."""
        return Motions(self.first, self.second, self.first_from_second, part * self.information, self.doubtful)

    def inside(self, row_of: Rows) -> Motions:
        """Give those between frames that stay, (F,) rows of which are given, -1 for the others."""
        kept = np.flatnonzero((row_of[self.first] >= 0) & (row_of[self.second] >= 0))
        return Motions(
            row_of[self.first[kept]],
            row_of[self.second[kept]],
            self.first_from_second[kept],
            self.information[kept],
            self.which_are_doubtful()[kept],
        )

    def checked(self, n_frames: int) -> Motions:
        """Give the same as arrays of the right kind, between frames that there are.

        Raises
        ------
        PomonaError
            A row is none of a frame, or that of the same frame twice; a pose is not rigid; an information is not
            positive definite; or they are not as many.
        """
        first, second = (
            checked_array(f"motions.{name}", getattr(self, name), np.int64, (None,)) for name in ("first", "second")
        )
        n = len(first)
        if len(second) != n:
            raise PomonaError(f"motions: found {n} first and {len(second)} second frames, expected as many")
        wrong = (np.minimum(first, second) < 0) | (np.maximum(first, second) >= n_frames) | (first == second)
        if wrong.any():
            row = int(np.argmax(wrong))
            found = f"found frames {first[row]} and {second[row]}"
            raise PomonaError(f"motions: row {row}: {found}, expected two of 0 to {n_frames - 1}")
        return Motions(
            first,
            second,
            rigid_motions("motions.first_from_second", self.first_from_second, (n, 4, 4)),
            definite_matrices("motions.information", self.information, (n, 6, 6)),
            checked_array("motions.doubtful", self.which_are_doubtful(), np.bool_, (n,)),
        )

    def which_are_doubtful(self) -> NDArray[np.bool_]:
        """Say it of each, (M,)."""
        return np.zeros(len(self), bool) if self.doubtful is None else np.asarray(self.doubtful, bool)


@dataclass(frozen=True, eq=False)
class Refined:
    """What explains sightings and motions best.

    Attributes
    ----------
    session_from_camera : (F, 4, 4) float64
        The first one is as it was given.
    centres : (N, 3) float64
        Of the fruits, in the session.
    covariances : (N, 3, 3) float64
        Of the centres while the poses stay: how well a fruit is known beside its neighbours. Drift, which moves
        neighbours together, is not in it.
    squared_errors : (S,) float64
        Squared Mahalanobis distance of each sighting; 3 is the mean of true ones.
    motion_squared_errors : (M,) float64
        The same of each motion; 6 is the mean of true ones.
    pose_covariances : (F, 6, 6) float64 or None
        Of the step (translation, rotation) of each pose in its own frame, the first pose being sure; None where they
        were not asked for, or not all frames hang together.
    """

    session_from_camera: Array
    centres: Array
    covariances: Array
    squared_errors: Array
    motion_squared_errors: Array
    pose_covariances: Array | None


def refine(
    session_from_camera: Array,
    sightings: SeenFruits,
    motions: Motions | None = None,
    *,
    with_pose_covariances: bool = False,
) -> Refined:
    """Adjust the poses and fruits of one part of a session, robustly (Cauchy's loss on sightings).

    Parameters
    ----------
    session_from_camera : (F, 4, 4) float64
        Poses to begin with. Frames that hang together neither by motions nor by fruits stay where they are.
    sightings : SeenFruits
        Which frame saw which fruit where.
    motions : Motions, optional
        What was measured between frames. Without them the poses are trusted, and only the fruits are adjusted.
    with_pose_covariances : bool
        Say how sure the poses are.

    Raises
    ------
    PomonaError
        When rows do not exist, lengths differ, numbers are not finite or a covariance is not positive definite.
    """
    poses = np.ascontiguousarray(session_from_camera, np.float64)
    _check(poses, sightings)
    fixed = np.full(len(poses), motions is None)
    fixed[:1] = True
    try:
        found = _core.adjust(
            poses,
            fixed,
            _medians(poses, sightings),
            places={
                "poses": np.ascontiguousarray(sightings.frames, np.int64),
                "points": np.ascontiguousarray(sightings.fruits, np.int64),
                "values": np.ascontiguousarray(sightings.centres_in_camera, np.float64),
                "whitenings": _whitenings(sightings.covariances),
            },
            relative_poses=None
            if motions is None
            else {
                "first": np.ascontiguousarray(motions.first, np.int64),
                "second": np.ascontiguousarray(motions.second, np.int64),
                "first_from_second": np.ascontiguousarray(motions.first_from_second, np.float64),
                "information": np.ascontiguousarray(motions.information, np.float64),
                "doubtful": motions.which_are_doubtful(),
            },
            pose_covariances=with_pose_covariances,
        )
    except ValueError as error:
        raise PomonaError(f"refinement: {error}") from None
    return Refined(*found)


def _check(poses: Array, sightings: SeenFruits) -> None:
    """Refuse what the adjustment would not name."""
    n = len(sightings)
    shapes = (sightings.fruits.shape, sightings.centres_in_camera.shape, sightings.covariances.shape)
    if shapes != ((n,), (n, 3), (n, 3, 3)):
        raise PomonaError(f"refinement: sightings: found shapes {shapes}, expected {(n,)}, {(n, 3)} and {(n, 3, 3)}")
    if poses.shape[1:] != (4, 4):
        raise PomonaError(f"refinement: poses: found shape {poses.shape}, expected (F, 4, 4)")
    if n and not 0 <= int(sightings.frames.min()) <= int(sightings.frames.max()) < len(poses):
        raise PomonaError(f"refinement: sightings: found a row of a frame outside the {len(poses)} poses")
    unseen = np.setdiff1d(np.arange(int(sightings.fruits.max(initial=-1)) + 1), sightings.fruits)
    if len(unseen):
        raise PomonaError(f"refinement: fruit {unseen[0]} was never seen, expected at least one sighting each")


def _whitenings(covariances: Array) -> Array:
    """W with W^T W = C^-1."""
    try:
        return np.ascontiguousarray(np.linalg.inv(np.linalg.cholesky(covariances)), np.float64)
    except np.linalg.LinAlgError:
        raise PomonaError("refinement: found a covariance that is not positive definite") from None


def _medians(poses: Array, sightings: SeenFruits) -> Array:
    """Where to begin: the median of each fruit's sightings."""
    seen_from = poses[sightings.frames]
    places = np.einsum("sij,sj->si", seen_from[:, :3, :3], sightings.centres_in_camera) + seen_from[:, :3, 3]
    order = np.argsort(sightings.fruits, kind="stable")
    bounds = np.flatnonzero(np.diff(sightings.fruits[order])) + 1
    groups = np.split(places[order], bounds) if len(sightings) else []
    return np.array([np.median(group, axis=0) for group in groups], np.float64).reshape(-1, 3)
