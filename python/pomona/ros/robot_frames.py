"""The frames of a robot (REP 103, REP 105) and where the localiser puts it in them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.localize import Localization
from pomona.ros.pose_covariance import fixed_axes_covariance
from pomona.step_covariance import carried_covariance

__all__ = ["BODY_FROM_OPTICAL", "RobotFrames", "RobotPose", "levelling"]

Array = NDArray[np.float64]

BODY_FROM_OPTICAL = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""REP 103: a body has x forward, y left, z up; an optical frame z forward, x right, y down."""


@dataclass(frozen=True, eq=False)
class RobotPose:
    """The robot in the map at one moment.

    Attributes
    ----------
    stamp_ns : int
        When the picture was taken.
    map_from_base : (4, 4) float64
    covariance : (6, 6) float64
        Of a step of the base in its own frame, as in `pomona.Localization`.
    """

    stamp_ns: int
    map_from_base: Array
    covariance: Array

    @property
    def fixed_axes(self) -> Array:
        """Covariance as `PoseWithCovariance` has it, (6, 6): x, y, z, turns about the axes of the map."""
        return fixed_axes_covariance(self.map_from_base, self.covariance)


@dataclass(frozen=True, eq=False)
class RobotFrames:
    """Names of the frames, and what is fixed between them.

    Attributes
    ----------
    map, base, camera : str
        The map; the robot's body; the optical frame of the left camera.
    base_from_camera : (4, 4) float64
        Takes points of the rectified left camera (x right, y down, z forward) into the body.
    optical_from_camera : (4, 4) float64
        Into the frame that the pictures name, which may be that of the camera before it was rectified.
    map_from_fruits : (4, 4) float64
        Takes the fruits' map into the frame `map`, whose z is up where the vertical is known.
    """

    map: str
    base: str
    camera: str
    base_from_camera: Array = field(default_factory=BODY_FROM_OPTICAL.copy)
    optical_from_camera: Array = field(default_factory=lambda: np.eye(4))
    map_from_fruits: Array = field(default_factory=lambda: np.eye(4))

    def place(self, found: Localization, stamp_ns: int) -> RobotPose:
        """Give the body's pose of a camera that was found.

        Raises
        ------
        PomonaError
            When it was not.
        """
        if found.map_from_camera is None:
            raise PomonaError(f"localization: found {found.status}, expected Found")
        pose = self.map_from_fruits @ found.map_from_camera @ np.linalg.inv(self.base_from_camera)
        return RobotPose(stamp_ns, pose, carried_covariance(self.base_from_camera, found.covariance))


def levelling(up: Array) -> Array:
    """Give the shortest turn (4, 4) that brings a direction of the map to z."""
    from scipy.spatial.transform import Rotation

    x, y, z = up / np.linalg.norm(up)
    axis, sine = np.array([y, -x, 0.0]), float(np.hypot(x, y))
    turn = np.eye(4)
    # Straight up or down no axis is the shortest: about x.
    axis = axis / sine if sine > 0 else np.array([1.0, 0, 0])
    turn[:3, :3] = Rotation.from_rotvec(np.arctan2(sine, z) * axis).as_matrix()
    return turn
