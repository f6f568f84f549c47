"""Covariances of poses, from the Localizer's way of saying them to that of ROS.

The Localizer's is of a step on the right, in the body's own frame: the true pose is T exp(x), x = (v, w), metres along
and radians about the body's axes. That of `geometry_msgs/PoseWithCovariance` is of the errors of x, y, z and of turns
about the fixed axes of the frame that the pose is in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["body_covariance", "fixed_axes_covariance"]

Array = NDArray[np.float64]


def body_covariance(body_from_camera: Array, covariance: Array) -> Array:
    """Give the covariance of a step of the body out of that of a camera that is fixed to it, both (6, 6).

    With X = body_from_camera, T exp(x) X^-1 = (T X^-1) exp(Ad x), Ad = [[R, [t] R], [0, R]].
    """
    R, t = body_from_camera[:3, :3], body_from_camera[:3, 3]
    adjoint = np.zeros((6, 6))
    adjoint[:3, :3] = adjoint[3:, 3:] = R
    adjoint[:3, 3:] = np.cross(np.eye(3), t) @ R
    return _symmetric(adjoint @ covariance @ adjoint.T)


def fixed_axes_covariance(map_from_body: Array, covariance: Array) -> Array:
    """Give the covariance (6, 6) as ROS has it: R exp(w) = exp(R w) R, and the place moves by R v."""
    turned = np.kron(np.eye(2), map_from_body[:3, :3])
    return _symmetric(turned @ covariance @ turned.T)


def _symmetric(covariance: Array) -> Array:
    return np.asarray((covariance + covariance.T) / 2)
