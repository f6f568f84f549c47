"""Where the camera went, from stereo or depth pictures alone."""

from pomona.odometry.motion import Motion
from pomona.odometry.stereo_odometry import StereoOdometry
from pomona.odometry.way import OdometryTrajectory

__all__ = ["Motion", "OdometryTrajectory", "StereoOdometry"]
