"""Recordings of robots: ROS 1 and ROS 2 bags and MCAP files, read without ROS."""

from pomona.recording.bags.kinds import recognises
from pomona.recording.bags.opening import open_bag

__all__ = ["open_bag", "recognises"]
