"""The keyframes that are still being adjusted, and the points that they see."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pomona import _core

__all__ = ["SIGMA_DISPARITY_PX", "SIGMA_PX", "Camera", "Window"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


class Camera(NamedTuple):
    """A camera in OpenCV's pixels, baseline in metres."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    baseline_m: float


SIGMA_PX = 0.5
SIGMA_DISPARITY_PX = 0.5
"""Standard deviations of a followed corner and of a disparity: on foliage the residuals of the adjustment scatter by
that much; on walls and bark by half of it."""

FREE = 5
"""Keyframes that an adjustment may move. A point is seen by fewer than that."""

HELD = 3
"""Older keyframes that stay where they are and hold the others through the points in common."""

GATE = 16.0
"""Squared Mahalanobis distance over which an observation is thrown away after an adjustment: 99.9 % of the true ones
are nearer (chi^2, 3 degrees of freedom)."""

MAX_STEPS = 6
"""Of one adjustment; the next keyframe goes on from there."""


@dataclass(eq=False)
class _Keyframe:
    number: int
    session_from_camera: Array
    points: Rows
    seen: Array


@dataclass(eq=False)
class Window:
    """Keyframes of one part, the newest adjusted together.

    Attributes
    ----------
    poses : list of (4, 4) float64
        Of all keyframes of the part, refined as long as they were in the window.
    information : list of (6, 6) float64
        Of each keyframe relative to the one before, none for the first: inverse covariance of the step (translation,
        rotation) in the later camera's own frame.
    positions, covariances : (P, 3), (P, 3, 3) float64
        Of the points from number `base` on, in the frame of reference of the part. The covariances are those while the
        keyframes stay.
    disparities_px : list of float
        Median disparity of each keyframe.
    """

    camera: Camera
    poses: list[Array] = field(default_factory=list)
    information: list[Array] = field(default_factory=list)
    base: int = 0
    positions: Array = field(default_factory=lambda: np.zeros((0, 3)))
    covariances: Array = field(default_factory=lambda: np.zeros((0, 3, 3)))
    disparities_px: list[float] = field(default_factory=list)
    _kept: deque[_Keyframe] = field(default_factory=deque)

    def add(self, session_from_camera: Array, points: Rows, seen: Array, fresh: Array) -> None:
        """Add a keyframe and adjust.

        Parameters
        ----------
        session_from_camera : (4, 4)
            Its pose as far as it is known.
        points : (N,) int64
            Numbers of the known points that it sees.
        seen : (N, 3)
            u, v, disparity; NaN for a disparity that was not measured.
        fresh : (M, 3)
            u, v, disparity of new points.
        """
        first = self.base + len(self.positions)
        numbers = np.arange(first, first + len(fresh), dtype=np.int64)
        keyframe = _Keyframe(
            len(self.poses), session_from_camera, np.concatenate([points, numbers]), np.concatenate([seen, fresh])
        )
        self.positions = np.concatenate([self.positions, np.zeros((len(fresh), 3))])
        self.covariances = np.concatenate([self.covariances, np.zeros((len(fresh), 3, 3))])
        self.poses.append(session_from_camera)
        self._kept.append(keyframe)
        self.disparities_px.append(float(np.nanmedian(np.concatenate([seen[:, 2], fresh[:, 2]]))))
        if len(self._kept) > 1:
            self.information.append(np.zeros((6, 6)))
            self._place_single(keyframe)
            self._adjust()
        self._place_single(keyframe)
        if len(self._kept) > FREE + HELD:
            self._kept.popleft()
        self._forget()

    @property
    def newest(self) -> tuple[Rows, Array]:
        """Numbers (N,) of the points that the newest keyframe sees, and u, v, disparity (N, 3)."""
        return self._kept[-1].points, self._kept[-1].seen

    def known(self, numbers: Rows) -> tuple[Array, Array]:
        """Positions (N, 3) and covariances (N, 3, 3) of points of the window."""
        rows = numbers - self.base
        return self.positions[rows], self.covariances[rows]

    def end(self) -> None:
        """Let go of the points; poses stay."""
        self._kept.clear()
        self.positions, self.covariances = np.zeros((0, 3)), np.zeros((0, 3, 3))

    def _adjust(self) -> None:
        """Adjust the window; observations that then lie outside the gate are thrown away."""
        frames = list(self._kept)
        counts = np.zeros(len(self.positions), np.int64)
        for frame in frames:
            counts[frame.points - self.base] += 1
        several = counts > 1
        row_of = np.cumsum(several) - 1
        used = [several[frame.points - self.base] for frame in frames]
        rows = [row_of[frame.points[use] - self.base] for frame, use in zip(frames, used, strict=True)]
        seen = np.concatenate([frame.seen[use] for frame, use in zip(frames, used, strict=True)])
        n_free = min(FREE, len(frames) - 1)
        fixed = np.arange(len(frames)) < len(frames) - n_free
        poses, positions, covariances, squared, information = _core.adjust(
            self.camera,
            np.stack([frame.session_from_camera for frame in frames]),
            fixed,
            self.positions[several],
            pictures={
                "poses": np.repeat(np.arange(len(frames)), [len(row) for row in rows]),
                "points": np.concatenate(rows),
                "values": np.nan_to_num(seen),
                "whitenings": whitenings(seen),
            },
            places=None,
            relative_poses=None,
            wanted=[(row, row + 1) for row in range(len(frames) - n_free - 1, len(frames) - 1)],
            max_steps=MAX_STEPS,
            first_scale=None,
        )
        self.positions[several], self.covariances[several] = positions, covariances
        for frame, pose in zip(frames, poses, strict=True):
            frame.session_from_camera = self.poses[frame.number] = pose
        for frame, found in zip(frames[len(frames) - n_free :], information, strict=True):
            self.information[frame.number - 1] = found
        bounds = np.cumsum([len(row) for row in rows])[:-1]
        for frame, use, errors in zip(frames, used, np.split(squared, bounds), strict=True):
            keep = np.ones(len(use), bool)
            keep[use] = errors < GATE
            frame.points, frame.seen = frame.points[keep], frame.seen[keep]

    def _place_single(self, keyframe: _Keyframe) -> None:
        """Place points that only the newest keyframe has seen, by its stereo alone."""
        rows = keyframe.points - self.base
        single = np.ones(len(self.positions), bool)
        for frame in self._kept:
            if frame is not keyframe:
                single[frame.points - self.base] = False
        alone = single[rows] & np.isfinite(keyframe.seen[:, 2])
        places, covariances = triangulated(self.camera, keyframe.seen[alone])
        rotation, translation = keyframe.session_from_camera[:3, :3], keyframe.session_from_camera[:3, 3]
        self.positions[rows[alone]] = places @ rotation.T + translation
        self.covariances[rows[alone]] = rotation @ covariances @ rotation.T

    def _forget(self) -> None:
        """Forget points that no kept keyframe sees."""
        oldest = min((int(frame.points.min()) for frame in self._kept if len(frame.points)), default=self.base)
        self.positions = self.positions[oldest - self.base :]
        self.covariances = self.covariances[oldest - self.base :]
        self.base = oldest


def whitenings(seen: Array) -> Array:
    """Give the diagonal whitening (N, 3, 3) of u, v, disparity (N, 3), zero where the disparity is NaN."""
    result = np.zeros((len(seen), 3, 3))
    result[:, 0, 0] = result[:, 1, 1] = 1 / SIGMA_PX
    result[:, 2, 2] = np.where(np.isfinite(seen[:, 2]), 1 / SIGMA_DISPARITY_PX, 0.0)
    return result


def triangulated(camera: Camera, seen: Array) -> tuple[Array, Array]:
    """Places (N, 3) in the camera of u, v, disparity (N, 3), and their covariances (N, 3, 3)."""
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    z = fx * camera.baseline_m / seen[:, 2]
    x, y = (seen[:, 0] - cx) / fx, (seen[:, 1] - cy) / fy
    places = np.stack([x * z, y * z, z], axis=1)
    slope = np.zeros((len(seen), 3, 3))
    slope[:, 0, 0], slope[:, 1, 1] = z / fx * SIGMA_PX, z / fy * SIGMA_PX
    slope[:, :, 2] = -places * (SIGMA_DISPARITY_PX / seen[:, 2])[:, None]
    return places, slope @ slope.transpose(0, 2, 1)
