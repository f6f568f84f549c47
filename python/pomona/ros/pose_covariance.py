"""Covariances of poses, from the Localizer's way of saying them to that of ROS.

The Localizer's is of a step on the right, in the body's own frame: the true pose is T exp(x), x = (v, w), metres along
and radians about the body's axes. That of `geometry_msgs/PoseWithCovariance` is of the errors of x, y, z and of turns
about the fixed axes of the frame that the pose is in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.step_covariance import symmetric

__all__ = ["fixed_axes_covariance"]

Array = NDArray[np.float64]


def fixed_axes_covariance(map_from_body: Array, covariance: Array) -> Array:
    """Give the covariance (6, 6) as ROS has it: R exp(w) = exp(R w) R, and the place moves by R v."""
    turned = np.kron(np.eye(2), map_from_body[:3, :3])
    return symmetric(turned @ covariance @ turned.T)
