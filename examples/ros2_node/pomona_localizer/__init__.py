"""A node of ROS 2 that says where a robot is in an orchard."""
