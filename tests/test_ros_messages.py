"""Messages of ROS 2 made without ROS: of rosbags' classes and of classes as strict as rclpy's."""

from __future__ import annotations

import array
import dataclasses
import functools
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from pomona import FruitCloud, Localization, PomonaError, Verdict
from pomona.ros import (
    RobotFrames,
    RobotPose,
    detections_message,
    known_store,
    odometry_message,
    path_message,
    pose_message,
    store_types,
    transforms_message,
)
from pomona.ros.foxglove_scene import fruits_scene, robot_scene
from pomona.ros.robot_frames import BODY_FROM_OPTICAL, levelling

STORES = {name: known_store(get_typestore(Stores[name])) for name in ("ROS2_HUMBLE", "ROS2_JAZZY", "LATEST")}
NS = 1_723_190_400_250_000_000


@functools.cache
def strict_class(name: str) -> type:
    """A class as rosidl makes it for rclpy: only named fields, and each of just its type."""
    fields = STORES["LATEST"].fielddefs[name][1]

    class Message:
        def __init__(self, **given: Any) -> None:
            assert given.keys() == {field for field, _ in fields}
            for field, (node, what) in fields:
                check(given[field], int(node), what)
                setattr(self, field, given[field])

    return Message


def check(value: Any, node: int, what: Any) -> None:
    if node == 1:  # a number, a text
        wanted = {"string": str, "bool": bool, "float64": float}.get(what[0], int)
        assert type(value) is wanted, (value, what)
    elif node == 2:  # another message
        assert isinstance(value, strict_class(what))
    elif what[0][0] == 1 and what[0][1][0] == "float64":  # an array of numbers
        assert isinstance(value, np.ndarray | array.array)
        assert len(value) == what[1]
        assert value.dtype == np.float64
    else:
        assert type(value) is list
        for each in value:
            check(each, int(what[0][0]), what[0][1])


def a_pose(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    pose[:3, 3] = rng.uniform(-5, 5, 3)
    return pose


def a_covariance(seed: int, size: float = 0.01) -> np.ndarray:
    spread = size * np.random.default_rng(seed).normal(size=(6, 6))
    return spread @ spread.T


def stepped(steps: np.ndarray) -> np.ndarray:
    """exp of steps (..., 6): v, w."""
    generators = np.zeros((*steps.shape[:-1], 4, 4))
    generators[..., :3, :3] = np.cross(np.eye(3), steps[..., None, 3:])
    generators[..., :3, 3] = steps[..., :3]
    return expm(generators)


def found(pose: np.ndarray, covariance: np.ndarray) -> Localization:
    none = np.zeros((0, 2), np.int64)
    return Localization(Verdict.FOUND, pose, covariance, none, np.zeros(0), 50.0, tracked=False)


def fruits() -> FruitCloud:
    covariances = np.array([np.diag([1e-4, 2e-4, 9e-4]), 1e-4 * np.eye(3)])
    return FruitCloud(
        np.array([[0.1, 0.2, 1.5], [-0.3, 0.0, 1.2]]),
        ids=("7", "9"),
        diameters_m=np.array([0.08, np.nan]),
        covariances=covariances,
        extras={"state": ("seen", "gone"), "last_seen": ("2024-08-09", "2024-08-02")},
    )


def all_messages(types) -> dict[str, Any]:
    before = RobotPose(NS - 500_000_000, a_pose(1), a_covariance(1))
    pose = RobotPose(NS, a_pose(1) @ stepped(np.array([0.5, 0, 0, 0, 0, 0.1])), a_covariance(2))
    return {
        "tf2_msgs/msg/TFMessage": transforms_message(types, NS, ("map", "odom", a_pose(3))),
        "geometry_msgs/msg/PoseWithCovarianceStamped": pose_message(types, "map", pose),
        "nav_msgs/msg/Odometry": odometry_message(types, "map", "base_link", pose, before),
        "nav_msgs/msg/Path": path_message(types, "map", [before, pose]),
        "vision_msgs/msg/Detection3DArray": detections_message(types, NS, "optical", fruits(), [(1, "42", 0.9)]),
        "foxglove_msgs/msg/SceneUpdate": fruits_scene(types, NS, "map", fruits()),
    }


def matrix(pose) -> np.ndarray:
    place = getattr(pose, "position", None) or pose.translation
    turn = getattr(pose, "orientation", None) or pose.rotation
    made = np.eye(4)
    made[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
    made[:3, 3] = (place.x, place.y, place.z)
    return made


@pytest.mark.parametrize("name", STORES)
def test_messages_come_back_from_the_bytes_of_each_ros(name):
    store = STORES[name]
    for kind, made in all_messages(store_types(store)).items():
        read = store.deserialize_cdr(store.serialize_cdr(made, kind), kind)
        assert repr(read) == repr(made)


def test_classes_as_strict_as_those_of_rclpy_take_all_fields():
    made = all_messages(strict_class)
    assert set(made) == set(all_messages(store_types(STORES["LATEST"])))
    scene = robot_scene(strict_class, "map", RobotPose(NS, a_pose(1), a_covariance(1)))
    assert matrix(scene.entities[0].arrows[0].pose) == pytest.approx(a_pose(1))


def test_headers_and_transforms_say_what_they_are_given():
    made = all_messages(store_types(STORES["ROS2_HUMBLE"]))
    step = made["tf2_msgs/msg/TFMessage"].transforms[0]
    assert (step.header.frame_id, step.child_frame_id) == ("map", "odom")
    assert (step.header.stamp.sec, step.header.stamp.nanosec) == (1_723_190_400, 250_000_000)
    assert matrix(step.transform) == pytest.approx(a_pose(3))


@pytest.mark.parametrize("seed", [1, 2])
def test_the_covariance_of_a_pose_is_that_of_sampled_poses(seed):
    """Draw true cameras as the Localizer says, and look how far the true bodies lie from the message's."""
    map_from_camera, base_from_camera = a_pose(10 + seed), a_pose(20 + seed)
    covariance = a_covariance(30 + seed, 0.004)
    frames = RobotFrames("map", "base_link", "optical", base_from_camera=base_from_camera)
    message = pose_message(
        store_types(STORES["LATEST"]), "map", frames.place(found(map_from_camera, covariance), NS)
    ).pose
    told = matrix(message.pose)
    np.testing.assert_allclose(told, map_from_camera @ np.linalg.inv(base_from_camera), atol=1e-12)
    steps = np.random.default_rng(seed).multivariate_normal(np.zeros(6), covariance, 4000)
    true = map_from_camera @ stepped(steps) @ np.linalg.inv(base_from_camera)
    # About the fixed axes of the map: the turn that comes after, on the left.
    turns = Rotation.from_matrix(true[:, :3, :3] @ told[:3, :3].T).as_rotvec()
    errors = np.hstack((true[:, :3, 3] - told[:3, 3], turns))
    sampled, expected = np.cov(errors.T), message.covariance.reshape(6, 6)
    sigmas = np.sqrt(np.diag(expected))
    assert np.abs(sampled - expected).max() / sigmas.max() ** 2 < 0.1
    np.testing.assert_allclose(np.sqrt(np.diag(sampled)), sigmas, rtol=0.05)


def test_a_body_without_a_tree_looks_where_its_camera_looks():
    """REP 103: the optical frame has z forward, the body x; a level camera that looks north in a map with z up."""
    map_from_camera = np.eye(4)
    map_from_camera[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    pose = RobotFrames("map", "body", "optical").place(found(map_from_camera, np.eye(6)), NS)
    np.testing.assert_allclose(pose.map_from_base[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(BODY_FROM_OPTICAL[:3, :3] @ [0, 0, 1], [1, 0, 0])


def test_a_frame_that_was_not_found_has_no_pose():
    lost = Localization(
        Verdict.NO_MATCH, None, np.zeros((6, 6)), np.zeros((0, 2), np.int64), np.zeros(0), np.nan, tracked=False
    )
    with pytest.raises(PomonaError, match="found NoMatch, expected Found"):
        RobotFrames("map", "base_link", "optical").place(lost, NS)


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 0, -2), (0, -1, 0), (0.3, -0.8, 0.2)])
def test_levelling_turns_up_to_z_and_mirrors_nothing(up):
    turn = levelling(np.array(up, float))
    np.testing.assert_allclose(turn[:3, :3] @ up / np.linalg.norm(up), [0, 0, 1], atol=1e-12)
    assert np.linalg.det(turn[:3, :3]) == pytest.approx(1)


def test_odometry_tells_the_mean_speed_in_the_axes_of_the_body():
    types = store_types(STORES["LATEST"])
    before = RobotPose(NS, a_pose(1), a_covariance(1))
    after = RobotPose(NS + 500_000_000, a_pose(1) @ stepped(np.array([0.5, 0, 0, 0, 0, 0])), a_covariance(2))
    twist = odometry_message(types, "map", "base_link", after, before).twist
    assert (twist.twist.linear.x, twist.twist.linear.y) == pytest.approx((1.0, 0.0), abs=1e-9)
    np.testing.assert_allclose(twist.covariance.reshape(6, 6), 4 * (a_covariance(1) + a_covariance(2)))
    first = odometry_message(types, "map", "base_link", before).twist
    assert first.twist.linear.x == 0
    assert first.covariance[0] == 1e6


def test_detections_have_the_ids_sizes_and_covariances_of_the_fruits():
    made = all_messages(store_types(STORES["LATEST"]))["vision_msgs/msg/Detection3DArray"]
    stranger, known = made.detections
    assert (stranger.id, known.id) == ("", "42")
    assert (stranger.results[0].hypothesis.score, known.results[0].hypothesis.score) == (0.0, 0.9)
    assert (stranger.bbox.size.x, known.bbox.size.x) == (0.08, 0.0)
    assert stranger.bbox.center.position.z == 1.5
    covariance = stranger.results[0].pose.covariance.reshape(6, 6)
    np.testing.assert_allclose(covariance[:3, :3], np.diag([1e-4, 2e-4, 9e-4]))
    assert covariance[5, 5] == pytest.approx(np.pi**2 / 3)


def test_fruits_are_drawn_by_state_and_by_growth():
    types = store_types(STORES["LATEST"])
    seen, gone = fruits_scene(types, NS, "map", fruits()).entities
    assert (seen.id, gone.id, seen.frame_id) == ("7", "9", "map")
    assert seen.spheres[0].size.x == 0.08
    assert seen.spheres[0].color.b > 0.6 > gone.spheres[0].color.b
    assert {note.key: note.value for note in seen.metadata} == {
        "state": "seen",
        "last_seen": "2024-08-09",
        "diameter_mm": "80.0",
    }
    grown = dataclasses.replace(fruits(), extras={"rate_mm_per_day": ("0.1", "0.6")})
    slow, fast = fruits_scene(types, NS, "map", grown).entities
    assert slow.spheres[0].color.g < 0.1
    assert fast.spheres[0].color.g > 0.8
