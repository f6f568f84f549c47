"""Robots: what the localiser knows as ROS 2 messages, made without ROS, and bags with these in them."""

from pomona.ros.message_types import MessageTypes, installed_types, known_store, store_types
from pomona.ros.robot_frames import RobotFrames, RobotPose
from pomona.ros.robot_messages import (
    detections_message,
    odometry_message,
    path_message,
    pose_message,
    sightings_of,
    transforms_message,
)

__all__ = [
    "MessageTypes",
    "RobotFrames",
    "RobotPose",
    "detections_message",
    "installed_types",
    "known_store",
    "odometry_message",
    "path_message",
    "pose_message",
    "sightings_of",
    "store_types",
    "transforms_message",
]
