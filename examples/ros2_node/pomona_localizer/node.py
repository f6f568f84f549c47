"""`ros2 run pomona_localizer localizer`: poses, transforms and fruits from a stereo camera, as it drives.

It was tested with a stand-in for rclpy, never on a live graph.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import rclpy
from message_filters import ApproximateTimeSynchronizer, Subscriber
from rclpy.duration import Duration
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.time import Time
from tf2_ros import Buffer, TransformBroadcaster, TransformException, TransformListener

from pomona import Localizer, PomonaError
from pomona.cloud import as_cloud
from pomona.detect.onnx import OnnxDetector
from pomona.detect.shipped import model_named
from pomona.recording.bags.frames_of_reference import matrix_of
from pomona.ros import (
    RobotFrames,
    RobotPose,
    detections_message,
    installed_types,
    odometry_message,
    pose_message,
    sightings_of,
    transforms_message,
)
from pomona.ros.live_camera import LiveCamera, optics_of_messages
from pomona.ros.map_axes import map_axes

PARAMETERS = {
    "map": "",
    "model": "shipped",
    "left": "/stereo/left/image_rect_color",
    "right": "/stereo/right/image_rect_color",
    "map_frame": "map",
    "odom_frame": "odom",
    "base_frame": "base_link",
    "pair_within_s": 0.01,
}

OUTLETS = {
    "status": "std_msgs/msg/String",
    "detections": "vision_msgs/msg/Detection3DArray",
    "pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "odometry": "nav_msgs/msg/Odometry",
}

PATIENCE = Duration(seconds=0.05)
"""A transform comes later than the picture that it is for."""


class LocalizerNode(Node):
    """Waits for both cameras, then answers every pair of pictures."""

    def __init__(self) -> None:
        super().__init__("pomona_localizer")
        for name, value in PARAMETERS.items():
            self.declare_parameter(name, value)
        self._fruits = as_cloud(self._told("map"))
        self._localizer = Localizer(self._fruits)
        self._map_from_fruits = map_axes(self._told("map"), None)
        self._detector = OnnxDetector.open(model_named(self._told("model")))
        self._infos: dict[str, Any] = {}
        self._camera: LiveCamera | None = None
        self._before: RobotPose | None = None
        self._odom_from_camera: np.ndarray | None = None
        self._transforms = Buffer()
        self._listener = TransformListener(self._transforms, self)
        self._broadcaster = TransformBroadcaster(self)
        self._outlets = {
            name: self.create_publisher(installed_types(kind), f"/pomona/{name}", 10) for name, kind in OUTLETS.items()
        }
        self._listen()

    def on_pair(self, left: Any, right: Any) -> None:
        """Look at a pair of pictures and tell what it says."""
        try:
            camera = self._opened()
            if camera is not None:
                self._answer(camera, left, right)
        except PomonaError as error:
            self.get_logger().warning(str(error))

    def _told(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _listen(self) -> None:
        pictures = []
        for side in ("left", "right"):
            topic = self._told(side)
            beside = f"{topic.rpartition('/')[0]}/camera_info"
            info, image = (installed_types(f"sensor_msgs/msg/{kind}") for kind in ("CameraInfo", "Image"))
            self.create_subscription(info, beside, partial(self._infos.setdefault, side), qos_profile_sensor_data)
            pictures.append(Subscriber(self, image, topic, qos_profile=qos_profile_sensor_data))
        self._pairs = ApproximateTimeSynchronizer(pictures, 5, self._told("pair_within_s"))
        self._pairs.registerCallback(self.on_pair)

    def _opened(self) -> LiveCamera | None:
        """Give the camera once both have said what they are."""
        if self._camera is None and len(self._infos) == 2:
            left, right = self._told("left"), self._told("right")
            optics = optics_of_messages(left, self._infos["left"], right, self._infos["right"])
            self._camera = LiveCamera(optics, self._detector, self._localizer)
        return self._camera

    def _answer(self, camera: LiveCamera, left: Any, right: Any) -> None:
        stamp, optical = left.header.stamp, left.header.frame_id
        stamp_ns = stamp.sec * 10**9 + stamp.nanosec
        odom_from_optical = self._between(self._told("odom_frame"), optical, stamp)
        odom_from_camera = None if odom_from_optical is None else odom_from_optical @ camera.optical_from_camera
        fruits, found = camera.look(left, right, self._moved(odom_from_camera))
        self._odom_from_camera = odom_from_camera  # of a pair that could not be looked at, the motion is not lost
        seen, known = fruits.transformed(camera.optical_from_camera), sightings_of(found, self._fruits)
        self._say("status", installed_types("std_msgs/msg/String")(data=str(found.status)))
        self._say("detections", detections_message(installed_types, stamp_ns, optical, seen, known))
        base_from_optical = self._between(self._told("base_frame"), optical, stamp)
        if not found or base_from_optical is None:
            return
        frames = RobotFrames(
            self._told("map_frame"),
            self._told("base_frame"),
            optical,
            base_from_camera=base_from_optical @ camera.optical_from_camera,
            optical_from_camera=camera.optical_from_camera,
            map_from_fruits=self._map_from_fruits,
        )
        pose = frames.place(found, stamp_ns)
        self._tell_pose(frames, pose)
        if odom_from_optical is not None:
            map_from_odom = pose.map_from_base @ base_from_optical @ np.linalg.inv(odom_from_optical)
            step = (frames.map, self._told("odom_frame"), map_from_odom)
            self._broadcaster.sendTransform(transforms_message(installed_types, stamp_ns, step).transforms)

    def _tell_pose(self, frames: RobotFrames, pose: RobotPose) -> None:
        self._say("pose", pose_message(installed_types, frames.map, pose))
        self._say("odometry", odometry_message(installed_types, frames.map, frames.base, pose, self._before))
        self._before = pose

    def _moved(self, odom_from_camera: np.ndarray | None) -> np.ndarray | None:
        """How the rectified camera moved since the pair before, where the tree tells it for both."""
        before = self._odom_from_camera
        return None if before is None or odom_from_camera is None else np.linalg.solve(before, odom_from_camera)

    def _between(self, target: str, source: str, stamp: Any) -> np.ndarray | None:
        """Give target_from_source of the tree of transforms, None where it does not tell."""
        try:
            found = self._transforms.lookup_transform(target, source, Time.from_msg(stamp), timeout=PATIENCE)
        except TransformException:
            return None
        return matrix_of(found.transform.translation, found.transform.rotation)

    def _say(self, name: str, message: Any) -> None:
        self._outlets[name].publish(message)


def main() -> None:
    """Run until it is ended."""
    rclpy.init()
    node = LocalizerNode()
    # Transforms are heard while a pair waits for one.
    executor = MultiThreadedExecutor(2)
    executor.add_node(node)
    try:
        executor.spin()
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
