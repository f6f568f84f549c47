"""One part of a drive: frames that hang together, followed from keyframe to keyframe."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pomona.odometry.features import corners
from pomona.odometry.reference import Found, Measure, Reference
from pomona.odometry.window import Camera, Window
from pomona.stereo.exposure import like

__all__ = ["Part", "Placed"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

MIN_INLIERS = 18
MIN_SHARE = 0.33
"""Points that must agree with a pose, and their part of those that were followed. Wrong poses of `rendered_row`, every
second frame, gather up to 13 of 43 points (30 %), true ones 25 or more (42 % or more)."""

SURE_INLIERS = 24
SURE_SHARE = 0.38
"""The same for a pose that is not where the motion so far leads to."""

SMOOTH_M = 0.15
SMOOTH_RAD = 0.15
"""How far from there that is: 0.15 m from frame to frame is 10 g at 25 frames/s, 9 degrees is 220 degrees/s."""

KEYFRAME_SHARE = 0.6
"""A new keyframe is due when fewer than this part of the last one's points agree."""

KEYFRAME_SHIFT = 0.1
KEYFRAME_RAD = 0.15
"""Or when the camera has moved by this part of the median depth, or turned by 9 degrees: then leaves hide leaves."""

WANTED_INLIERS = 120
"""Points that a keyframe should share with the one before; with 0.5 px each they turn it to half a milliradian."""

CORNERS_PER_CELL = (3, 12)
"""Bounds of what is followed for that: on walls nearly all corners agree, on foliage from 20 cm further one in ten."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A frame with its pose in a keyframe; its information is None for the keyframe itself."""

    keyframe: int
    keyframe_from_camera: Array
    information: Array | None
    inliers: int


@dataclass(eq=False)
class Part:
    """Frames that hang together; the first one's camera is the frame of reference.

    Attributes
    ----------
    window : Window
        The keyframes.
    frames : dict
        What is known of each placed frame, by its number.
    """

    camera: Camera
    window: Window
    frames: dict[int, Placed] = field(default_factory=dict)
    _reference: Reference | None = None
    _last_frame: int = 0
    _last_pose: Array = field(default_factory=lambda: np.eye(4))
    _velocity: Array | None = None
    _per_cell: int = CORNERS_PER_CELL[1]

    @classmethod
    def begin(cls, camera: Camera, frame: int, picture: Picture, measure: Measure) -> Part | str:
        """Begin with a frame, or say why it is none to begin with."""
        part = cls(camera, Window(camera), _last_frame=frame)
        offered = len(part._add_keyframe(frame, picture, np.eye(4), measure, None).numbers)
        if offered < MIN_INLIERS:
            return f"found {offered} points with depth, expected at least {MIN_INLIERS}"
        return part

    def place(self, frame: int, picture: Picture, measure: Measure) -> bool | str:
        """Place a frame: whether it became a keyframe, or why it cannot be placed."""
        reason, reference = "", self._newest
        compared = like(picture, reference.picture)
        for expected in self._expected(frame, compared):
            found = reference.locate(compared, expected)
            objection = "found no points to follow" if found is None else self._objection(frame, found)
            if found is not None and not objection:
                return self._accept(frame, picture, measure, found)
            reason = reason or objection
        return reason

    def end(self) -> None:
        """Let go of pictures and points; poses stay."""
        self._reference = None
        self.window.end()

    def pose(self, frame: int) -> Array:
        """Pose of a placed frame, as refined so far."""
        placed = self.frames[frame]
        return np.asarray(self.window.poses[placed.keyframe] @ placed.keyframe_from_camera, np.float64)

    def _expected(self, frame: int, picture: Picture) -> Iterator[Array]:
        """Poses to look from: where the motion so far leads to, at rest, and where patches are found again."""
        yield self._predicted(frame)
        if self._velocity is not None:
            yield self._last_pose
        found = self._newest.find_again(picture, self._last_pose)
        if found is not None:
            yield found

    def _predicted(self, frame: int) -> Array:
        """Where the motion so far leads to."""
        if self._velocity is None:
            return self._last_pose
        moved = self._last_pose @ np.linalg.matrix_power(self._velocity, frame - self._last_frame)
        return np.asarray(moved, np.float64)

    def _objection(self, frame: int, found: Found) -> str:
        """Why a pose is not to be believed, nothing where it is."""
        away = np.linalg.inv(self._predicted(frame)) @ found.pose
        shift, turn = float(np.linalg.norm(away[:3, 3])), _angle(away)
        smooth = self._velocity is not None and shift < SMOOTH_M and turn < SMOOTH_RAD
        least, share = (MIN_INLIERS, MIN_SHARE) if smooth else (SURE_INLIERS, SURE_SHARE)
        needed = max(least, int(share * found.followed))
        if found.inliers >= needed:
            return ""
        jump = "" if smooth else f", {shift:.2f} m and {np.degrees(turn):.0f} degrees from where the motion leads"
        return f"found {found.inliers} of {found.followed} points that agree{jump}, expected at least {needed}"

    def _accept(self, frame: int, picture: Picture, measure: Measure, found: Found) -> bool:
        self._velocity = _root(np.linalg.inv(self._last_pose) @ found.pose, frame - self._last_frame)
        self._last_frame, self._last_pose = frame, found.pose
        if self._is_keyframe(found):
            self._add_keyframe(frame, picture, found.pose, measure, found)
            self._last_pose = self.window.poses[-1]
            return True
        relative = np.linalg.inv(self.window.poses[-1]) @ found.pose
        self.frames[frame] = Placed(len(self.window.poses) - 1, relative, found.information, found.inliers)
        return False

    def _is_keyframe(self, found: Found) -> bool:
        reference = self._newest
        moved = np.linalg.inv(reference.pose) @ found.pose
        depths = (reference.positions[found.agrees] - found.pose[:3, 3]) @ found.pose[:3, 2]
        return bool(
            found.inliers < KEYFRAME_SHARE * len(reference.numbers)
            or np.linalg.norm(moved[:3, 3]) > KEYFRAME_SHIFT * np.median(depths)
            or _angle(moved) > KEYFRAME_RAD
        )

    def _add_keyframe(
        self, frame: int, picture: Picture, pose: Array, measure: Measure, found: Found | None
    ) -> Reference:
        """Make a frame the reference: points that agree go on, new corners fill the gaps."""
        numbers, places, expected = np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0)
        if found is not None:
            numbers, places = self._newest.numbers[found.agrees], found.places[found.agrees]
            depths = (self._newest.positions[found.agrees] - pose[:3, 3]) @ pose[:3, 2]
            expected = self.camera.fx * self.camera.baseline_m / depths
            per_cell = int(np.ceil(self._per_cell * WANTED_INLIERS / found.inliers))
            self._per_cell = int(np.clip(per_cell, *CORNERS_PER_CELL))
        new = corners(picture, places, self._per_cell)
        everything = np.concatenate([places, new])
        seen = np.column_stack([everything, measure(everything, np.concatenate([expected, np.full(len(new), np.nan)]))])
        fresh = seen[len(places) :]
        self.window.add(pose, numbers, seen[: len(places)], fresh[np.isfinite(fresh[:, 2])])
        self.frames[frame] = Placed(len(self.window.poses) - 1, np.eye(4), None, len(numbers))
        numbers, seen = self.window.newest
        known = self.window.known(numbers)
        newest = self.window.poses[-1]
        self._reference = Reference(self.camera, picture, measure, newest, numbers, seen[:, :2], *known)
        return self._reference

    @property
    def _newest(self) -> Reference:
        """The newest keyframe, which a part has from its begin to its end."""
        assert self._reference is not None
        return self._reference


def _angle(transform: Array) -> float:
    """Angle of a rotation, radians."""
    return float(np.arccos(np.clip((np.trace(transform[:3, :3]) - 1) / 2, -1.0, 1.0)))


def _root(motion: Array, steps: int) -> Array:
    """One of `steps` equal parts of a motion; the translation's turn on the way is neglected."""
    if steps == 1:
        return motion
    from scipy.spatial.transform import Rotation

    part = np.eye(4)
    part[:3, :3] = Rotation.from_rotvec(Rotation.from_matrix(motion[:3, :3]).as_rotvec() / steps).as_matrix()
    part[:3, 3] = motion[:3, 3] / steps
    return part
