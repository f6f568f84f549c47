"""What is known of single poses from outside: places by GNSS, verticals by an IMU; a graph that hangs on them.

Both are relative poses from a fixed origin: of a place the information has no turn, of a vertical no place, and no turn
about itself. The frame of reference is then that of the places, with z up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pomona.arrays import checked_array, definite_matrices
from pomona.errors import PomonaError
from pomona.survey.refinement import Motions, Refined, SeenFruits, refine

__all__ = ["Anchors", "anchored"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

ROUNDS = 4
"""A vertical leaves the turn about itself open, which is taken from the poses of the round before."""

CAMERA_UP = np.array([0.0, -1.0, 0.0])
"""Of a camera that nobody asked how it is held: y is down in pictures."""


@dataclass(frozen=True, eq=False)
class Anchors:
    """Places and verticals of some frames; either may be empty.

    Attributes
    ----------
    frames : (A,) int64
        Rows of the frames whose places are known.
    positions : (A, 3) float64
        Of the camera, metres, z up.
    covariances : (A, 3, 3) float64
        Square metres. A place may be wrong altogether, of a reflection: then it is let go.
    upright_frames : (V,) int64
        Rows of the frames whose vertical is known.
    ups_in_camera : (V, 3) float64
        Where up is, in the frame of the camera; of any length.
    up_sigma_rad : float
        Standard deviation of each, about either horizontal axis.
    """

    frames: Rows
    positions: Array
    covariances: Array
    upright_frames: Rows
    ups_in_camera: Array
    up_sigma_rad: float = 0.02

    def __post_init__(self) -> None:
        for name in ("frames", "upright_frames"):
            object.__setattr__(self, name, checked_array(f"anchors.{name}", getattr(self, name), np.int64, (None,)))
        for name in ("positions", "ups_in_camera"):
            object.__setattr__(self, name, checked_array(f"anchors.{name}", getattr(self, name), np.float64, (None, 3)))
            _require_finite(f"anchors.{name}", getattr(self, name))
        n, n_ups = len(self.frames), len(self.upright_frames)
        covariances = definite_matrices("anchors.covariances", self.covariances, (n, 3, 3))
        object.__setattr__(self, "covariances", covariances)
        if (len(self.positions), len(self.ups_in_camera)) != (n, n_ups):
            found = f"{len(self.positions)} positions and {len(self.ups_in_camera)} verticals"
            raise PomonaError(f"anchors: found {found}, expected {n} and {n_ups}")
        if not (self.up_sigma_rad > 0 and (np.linalg.norm(self.ups_in_camera, axis=1) > 0).all()):
            raise PomonaError("anchors: found a vertical without a direction or a sigma of nothing, expected both")

    @classmethod
    def of_places(cls, frames: Rows, positions: Array, covariances: Array) -> Anchors:
        """Take places alone."""
        return cls(frames, positions, covariances, np.zeros(0, np.int64), np.zeros((0, 3)))

    @classmethod
    def of_verticals(cls, frames: Rows, ups_in_camera: Array, up_sigma_rad: float = 0.02) -> Anchors:
        """Take verticals alone."""
        nothing = (np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))
        return cls(*nothing, frames, ups_in_camera, up_sigma_rad)

    def __len__(self) -> int:
        return len(self.frames) + len(self.upright_frames)

    def inside(self, row_of: Rows) -> Anchors:
        """Give those of the frames whose new row is not -1."""
        places, ups = row_of[self.frames], row_of[self.upright_frames]
        return Anchors(
            places[places >= 0],
            self.positions[places >= 0],
            self.covariances[places >= 0],
            ups[ups >= 0],
            self.ups_in_camera[ups >= 0],
            self.up_sigma_rad,
        )


def _require_finite(name: str, values: Array) -> None:
    wrong = ~np.isfinite(values).all(axis=1)
    if wrong.any():
        raise PomonaError(f"{name}: row {int(np.argmax(wrong))}: found a number that is not finite")


def anchored(poses: Array, sightings: SeenFruits, motions: Motions, anchors: Anchors) -> Refined:
    """Adjust poses and fruits to what is known from outside too.

    Parameters
    ----------
    poses : (F, 4, 4) float64
        To begin with, in any frame of reference.
    sightings, motions
        As in `pomona.refine`.
    anchors : Anchors
        Rows are those of the poses.

    Returns
    -------
    Refined
        In the frame of the anchors. What they leave open, as places without a vertical leave the turn about a straight
        row, stays as the cameras are thought to be held.
    """
    placed = _laid(poses, anchors)
    seen, moved = replace(sightings, frames=sightings.frames + 1), _later(motions)
    n_before = len(motions)
    for _ in range(ROUNDS):
        held = moved.and_those(_places(anchors)).and_those(_verticals(anchors, placed))
        with_origin = np.concatenate([np.eye(4)[None], placed])
        found = refine(with_origin, seen, held, with_pose_covariances=True)
        placed = found.session_from_camera[1:]
    spread = found.pose_covariances
    return replace(
        found,
        session_from_camera=placed,
        motion_squared_errors=found.motion_squared_errors[:n_before],
        pose_covariances=None if spread is None else spread[1:],
    )


def _later(motions: Motions) -> Motions:
    """Give the motions with the origin as the first of all rows."""
    rows = motions.first + 1, motions.second + 1
    return Motions(*rows, motions.first_from_second, motions.information, motions.doubtful)


def _places(anchors: Anchors) -> Motions:
    n = len(anchors.frames)
    poses, information = np.tile(np.eye(4), (n, 1, 1)), np.zeros((n, 6, 6))
    poses[:, :3, 3] = anchors.positions
    information[:, :3, :3] = np.linalg.inv(anchors.covariances)
    return Motions(np.zeros(n, np.int64), anchors.frames + 1, poses, information, np.ones(n, bool))


def _verticals(anchors: Anchors, poses: Array) -> Motions:
    """Give each pose as it is, turned on the shortest way to where its up is up."""
    n = len(anchors.upright_frames)
    ups = anchors.ups_in_camera / np.linalg.norm(anchors.ups_in_camera, axis=1, keepdims=True)
    held, information = poses[anchors.upright_frames].copy(), np.zeros((n, 6, 6))
    for pose, up in zip(held, ups, strict=True):
        pose[:3, :3] = _to_up(pose[:3, :3] @ up) @ pose[:3, :3]
    information[:, 3:, 3:] = (np.eye(3) - ups[:, :, None] * ups[:, None, :]) / anchors.up_sigma_rad**2
    return Motions(np.zeros(n, np.int64), anchors.upright_frames + 1, held, information, np.zeros(n, bool))


def _laid(poses: Array, anchors: Anchors) -> Array:
    """Bring the poses upright, then onto the places."""
    ups = poses[anchors.upright_frames, :3, :3] @ anchors.ups_in_camera[:, :, None]
    up = ups.sum(axis=0)[:, 0] if len(ups) else poses[:, :3, :3].mean(axis=0) @ CAMERA_UP
    motion = np.eye(4)
    motion[:3, :3] = _to_up(up / np.linalg.norm(up))
    if not len(anchors.frames):
        return np.asarray(motion @ poses)
    here = poses[anchors.frames, :3, 3] @ motion[:3, :3].T
    middle, true_middle = here.mean(axis=0), anchors.positions.mean(axis=0)
    motion[:3, :3] = _heading(here - middle, anchors.positions - true_middle) @ motion[:3, :3]
    motion[:3, 3] = true_middle - motion[:3, :3] @ poses[anchors.frames, :3, 3].mean(axis=0)
    return np.asarray(motion @ poses)


def _to_up(direction: Array) -> Array:
    """Shortest rotation of a unit vector to z."""
    from scipy.spatial.transform import Rotation

    axis = np.cross(direction, [0.0, 0.0, 1.0])
    sine, cosine = float(np.linalg.norm(axis)), float(direction[2])
    if sine < 1e-12:
        return np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
    return np.asarray(Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine)).as_matrix())


def _heading(here: Array, there: Array) -> Array:
    """Turn about z that brings some points nearest to others."""
    cosine = float((here[:, :2] * there[:, :2]).sum())
    sine = float((here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0]).sum())
    angle = np.arctan2(sine, cosine)
    turn = np.eye(3)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn
