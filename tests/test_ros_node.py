"""The node of examples/ros2_node, run with a stand-in for rclpy that is as strict about messages as rclpy is."""

# ruff: noqa: ARG002, ARG005 (a stand-in takes what it need not use)

from __future__ import annotations

import importlib
import sys
import xml.etree.ElementTree as ET
from collections import defaultdict
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from bag_maker import ROS2, message
from pomona import Localizer
from pomona.ros import store_types, transforms_message
from robot_bag import BASE, BASE_FROM_CAMERA, CAMERA, MAP, ODOM_FROM_MAP, RobotBag, entries, true_poses
from test_ros_messages import matrix, strict_class

PACKAGE = Path(__file__).parents[1] / "examples" / "ros2_node"
MESSAGES = ("std_msgs", "sensor_msgs", "geometry_msgs", "nav_msgs", "tf2_msgs", "vision_msgs", "builtin_interfaces")
SETTINGS = {"map": str(MAP)}


class Graph:
    """What the node sent and heard, and the transforms that it can look up."""

    def __init__(self) -> None:
        self.sent, self.callbacks = defaultdict(list), {}
        self.transforms: dict[tuple[str, str], np.ndarray] = {}
        self.warnings: list[str] = []


class TransformError(Exception):
    pass


def stand_in(graph: Graph) -> dict[str, ModuleType]:
    """The modules that the node imports."""

    class Node:
        def __init__(self, name):
            self.parameters = {}

        def declare_parameter(self, name, value):
            self.parameters[name] = SETTINGS.get(name, value)

        def get_parameter(self, name):
            return SimpleNamespace(value=self.parameters[name])

        def create_publisher(self, kind, topic, depth):
            def publish(content):
                assert type(content) is kind
                graph.sent[topic].append(content)

            return SimpleNamespace(publish=publish)

        def create_subscription(self, kind, topic, callback, qos):
            graph.callbacks[topic] = callback

        def get_logger(self):
            return SimpleNamespace(warning=graph.warnings.append)

    class Buffer:
        def lookup_transform(self, target, source, time, timeout):
            if (target, source) not in graph.transforms:
                raise TransformError
            types = store_types(ROS2)
            return transforms_message(types, 0, (target, source, graph.transforms[target, source])).transforms[0]

    class Synchronizer:
        def __init__(self, subscribers, queue, slop):
            assert [each.topic for each in subscribers] == [
                "/stereo/left/image_rect_color",
                "/stereo/right/image_rect_color",
            ]

        def registerCallback(self, callback):  # noqa: N802
            graph.callbacks["pair"] = callback

    def subscriber(node, kind, topic, qos_profile):
        return SimpleNamespace(topic=topic)

    broadcaster = SimpleNamespace(sendTransform=graph.sent["/tf"].extend)
    contents = {
        "rclpy": {"init": None, "try_shutdown": None},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {"qos_profile_sensor_data": object()},
        "rclpy.time": {"Time": SimpleNamespace(from_msg=lambda stamp: stamp)},
        "rclpy.duration": {"Duration": lambda seconds: seconds},
        "rclpy.executors": {"MultiThreadedExecutor": None},
        "message_filters": {"ApproximateTimeSynchronizer": Synchronizer, "Subscriber": subscriber},
        "tf2_ros": {
            "Buffer": Buffer,
            "TransformListener": lambda buffer, node: None,
            "TransformBroadcaster": lambda node: broadcaster,
            "TransformException": TransformError,
        },
    }
    modules = {}
    for name, members in contents.items():
        modules[name] = ModuleType(name)
        vars(modules[name]).update(members)
    for package in MESSAGES:
        modules[package], modules[f"{package}.msg"] = ModuleType(package), ModuleType(f"{package}.msg")
        modules[f"{package}.msg"].__getattr__ = lambda kind, package=package: strict_class(f"{package}/msg/{kind}")
    return modules


@pytest.fixture
def graph(monkeypatch) -> Graph:
    graph = Graph()
    for name, module in stand_in(graph).items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.syspath_prepend(str(PACKAGE))
    for name in ("pomona_localizer", "pomona_localizer.node"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    importlib.import_module("pomona_localizer.node").LocalizerNode()
    for name in ("pomona_localizer", "pomona_localizer.node"):
        monkeypatch.delitem(sys.modules, name)
    return graph


@pytest.fixture(scope="module")
def drive() -> dict[str, list]:
    """The messages of the robot's bag, by topic."""
    found = defaultdict(list)
    for topic, _, kind, fields in entries():
        found[topic].append(message(ROS2, kind, fields))
    return found


def drive_past(graph: Graph, drive: dict[str, list], n: int) -> None:
    for side in ("left", "right"):
        graph.callbacks[f"/stereo/{side}/camera_info"](drive[f"/stereo/{side}/camera_info"][0])
    for row in range(n):
        pose = true_poses()[row]
        graph.transforms["odom", CAMERA] = ODOM_FROM_MAP @ pose
        graph.callbacks["pair"](*(drive[f"/stereo/{side}/image_rect_color"][row] for side in ("left", "right")))


def test_pairs_become_poses_fruits_and_transforms(graph, drive):
    graph.transforms[BASE, CAMERA] = BASE_FROM_CAMERA
    drive_past(graph, drive, 2)
    assert graph.warnings == []
    assert [status.data for status in graph.sent["/pomona/status"]] == ["Found", "Found"]
    true = RobotBag(Path(), Path(), true_poses()).map_from_base
    for pose, step, where in zip(graph.sent["/pomona/pose"], graph.sent["/tf"], true, strict=False):
        off = np.linalg.solve(matrix(pose.pose.pose), where)
        assert np.linalg.norm(off[:3, 3]) < 0.1
        assert (pose.header.frame_id, step.header.frame_id, step.child_frame_id) == ("map", "map", "odom")
        through = matrix(step.transform) @ ODOM_FROM_MAP @ where
        np.testing.assert_allclose(through, matrix(pose.pose.pose), atol=1e-6)
    assert len(graph.sent["/pomona/odometry"]) == len(graph.sent["/tf"]) == 2
    assert graph.sent["/pomona/odometry"][1].child_frame_id == BASE
    assert graph.sent["/pomona/odometry"][1].twist.covariance[0] < 1e6
    detections = graph.sent["/pomona/detections"][1]
    assert detections.header.frame_id == CAMERA
    assert sum(bool(each.id) for each in detections.detections) > 10


def test_without_a_place_of_the_camera_on_the_robot_no_pose_is_told(graph, drive):
    drive_past(graph, drive, 1)
    assert [status.data for status in graph.sent["/pomona/status"]] == ["Found"]
    assert not graph.sent["/pomona/pose"]
    assert not graph.sent["/tf"]


def test_before_the_cameras_are_known_nothing_is_said(graph, drive):
    graph.callbacks["pair"](*(drive[f"/stereo/{side}/image_rect_color"][0] for side in ("left", "right")))
    assert not any(graph.sent.values())


def test_the_motion_past_a_pair_that_cannot_be_looked_at_is_not_lost(graph, drive, monkeypatch):
    moved = []
    update = Localizer.update

    def noting(self, cloud, step, **known):
        moved.append(step)
        return update(self, cloud, step, **known)

    monkeypatch.setattr(Localizer, "update", noting)
    intact = drive["/stereo/left/image_rect_color"]
    broken = [intact[0], SimpleNamespace(**{**vars(intact[1]), "encoding": "secret"}), *intact[2:]]
    drive_past(graph, {**drive, "/stereo/left/image_rect_color": broken}, 3)
    assert len(graph.warnings) == 1
    assert moved[0] is None
    np.testing.assert_allclose(moved[1], np.linalg.solve(*true_poses()[[0, 2]]), atol=1e-9)


def test_a_picture_that_is_none_is_a_warning(graph, drive):
    for side in ("left", "right"):
        graph.callbacks[f"/stereo/{side}/camera_info"](drive[f"/stereo/{side}/camera_info"][0])
    left = drive["/stereo/left/image_rect_color"][0]
    broken = SimpleNamespace(**{**vars(left), "encoding": "secret"})
    graph.callbacks["pair"](broken, left)
    assert len(graph.warnings) == 1
    assert "'secret'" in graph.warnings[0]


def test_the_package_names_what_it_imports_and_that_it_was_not_run():
    package = ET.parse(PACKAGE / "package.xml").getroot()
    needed = {each.text for each in package.findall("exec_depend")}
    assert {"rclpy", "message_filters", "tf2_ros", "vision_msgs"} <= needed
    node = (PACKAGE / "pomona_localizer" / "node.py").read_text()
    for text in (package.findtext("description"), node):
        assert "never on a live graph" in text
