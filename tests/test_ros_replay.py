"""`pomona ros replay`: a bag in, the same bag out with poses, transforms, fruits and scenes; read back by rosbags."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from collections import defaultdict
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bag_maker import START_NS, image, info, stereo, tf, write_bag
from command_line import run
from pomona import FruitCloud, PomonaError, PomonaWarning
from pomona.recording import open_recording
from pomona.recording.bags.bag_recording import BagRecording
from pomona.recording.bags.kinds import open_messages
from pomona.recording.bags.message_file import Message, Topic
from pomona.ros import known_store
from pomona.ros.bag_frames import frames_of_bag
from pomona.ros.ros1_as_ros2 import AsRos2
from robot_bag import BASE, BASE_FROM_CAMERA, CAMERA, FRAMES, MAP, ODOM_FROM_MAP, STEP_NS, entries, make_robot_bag
from test_ros_messages import matrix

EYE = np.eye(4)
OURS = {"pose", "odometry", "path", "detections", "status", "fruits", "robot"}


replay = partial(run, "ros", "replay")


def read(path: Path) -> tuple[list[tuple[str, int, bytes]], dict[str, list]]:
    """All messages in order, as bytes; those of each topic decoded by the definitions that the file has."""
    order, decoded = [], defaultdict(list)
    with AnyReader([path], default_typestore=get_typestore(Stores.EMPTY)) as reader:
        for connection, logged_ns, body in reader.messages():
            order.append((connection.topic, logged_ns, bytes(body)))
            decoded[connection.topic].append(reader.deserialize(body, connection.msgtype))
    return order, decoded


def refused(done: subprocess.CompletedProcess[str], output: Path, *parts: str) -> None:
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if not line.startswith("pomona: warning: ")]
    assert len(lines) == 1
    for part in parts:
        assert part in lines[0]
    assert not output.exists()


@pytest.fixture(scope="module")
def replayed(tmp_path_factory) -> SimpleNamespace:
    folder = tmp_path_factory.mktemp("robot")
    bag = make_robot_bag(folder)
    output = folder / "out.mcap"
    done = replay(bag.path, output, "--map", MAP, "--detections", bag.boxes, "--json")
    assert done.returncode == 0, done.stderr
    order, decoded = read(output)
    return SimpleNamespace(bag=bag, output=output, told=json.loads(done.stdout), order=order, decoded=decoded)


def test_the_bag_is_there_unchanged_and_ours_are_added_in_order_of_time(replayed):
    before, _ = read(replayed.bag.path)
    ours = {f"/pomona/{name}" for name in OURS}
    theirs = [message for message in replayed.order if message[0] not in ours]
    added = [message for message in theirs if message not in before]
    assert {topic for topic, *_ in added} == {"/tf"}
    assert [message for message in theirs if message not in added] == before
    assert ours <= {topic for topic, *_ in replayed.order}
    times_ns = [logged_ns for _, logged_ns, _ in replayed.order]
    assert times_ns == sorted(times_ns)
    assert (replayed.told["n_copied"], replayed.told["n_added"]) == (len(before), len(replayed.order) - len(before))


def test_our_messages_are_logged_when_the_last_picture_of_their_frame_was(replayed):
    logged = [logged_ns for topic, logged_ns, _ in replayed.order if topic == "/pomona/pose"]
    assert logged == [START_NS + row * STEP_NS + 5_000_000 for row in range(len(FRAMES))]
    stamps = [message.header.stamp for message in replayed.decoded["/pomona/pose"]]
    assert [stamp.sec * 10**9 + stamp.nanosec for stamp in stamps] == [
        START_NS + row * STEP_NS for row in range(len(FRAMES))
    ]


def test_poses_are_those_of_the_body_in_the_map(replayed):
    poses = replayed.decoded["/pomona/pose"]
    assert replayed.told["frames"] == {"map": "map", "root": "odom", "base": BASE, "camera": CAMERA}
    for message, odometry, true in zip(
        poses, replayed.decoded["/pomona/odometry"], replayed.bag.map_from_base, strict=True
    ):
        assert message.header.frame_id == odometry.header.frame_id == "map"
        assert odometry.child_frame_id == BASE
        off = np.linalg.solve(matrix(message.pose.pose), true)
        assert np.linalg.norm(off[:3, 3]) < 0.08
        assert np.degrees(np.arccos((np.trace(off[:3, :3]) - 1) / 2)) < 2.0
        assert np.linalg.eigvalsh(message.pose.covariance.reshape(6, 6)).min() > 0
    path = replayed.decoded["/pomona/path"][-1]
    assert [repr(each.pose) for each in path.poses] == [repr(message.pose.pose) for message in poses]


def test_the_tree_leads_from_the_map_over_odom_to_the_body(replayed):
    """REP 105: map -> odom puts the robot where it was found, with the bag's own odom -> base_link."""
    ours = [message for message in replayed.decoded["/tf"] if message.transforms[0].header.frame_id == "map"]
    assert len(ours) == len(FRAMES)
    poses = replayed.decoded["/pomona/pose"]
    for message, pose, true in zip(ours, poses, replayed.bag.map_from_base, strict=True):
        step = message.transforms[0]
        assert step.child_frame_id == "odom"
        map_from_odom, odom_from_base = matrix(step.transform), ODOM_FROM_MAP @ true
        np.testing.assert_allclose(map_from_odom @ odom_from_base, matrix(pose.pose.pose), atol=1e-6)


def test_fruits_are_seen_in_the_optical_frame_and_have_the_ids_of_the_map(replayed):
    ids = {line.split(",")[0] for line in MAP.read_text().splitlines()[1:]}
    for message, pose in zip(replayed.decoded["/pomona/detections"], replayed.decoded["/pomona/pose"], strict=True):
        assert message.header.frame_id == CAMERA
        known = [each for each in message.detections if each.id]
        assert len(known) > 10
        assert {each.id for each in known} <= ids
        assert all(each.bbox.center.position.z > 0.5 for each in message.detections)
        assert all(each.results[0].pose.covariance[0] > 0 for each in message.detections)
        map_from_camera = matrix(pose.pose.pose) @ BASE_FROM_CAMERA
        drawn = {each.id: each.spheres[0].pose.position for each in replayed.decoded["/pomona/fruits"][0].entities}
        off = [
            np.linalg.norm((map_from_camera @ [*vars_of(each.bbox.center.position), 1])[:3] - vars_of(drawn[each.id]))
            for each in known
        ]
        assert np.median(off) < 0.05


def vars_of(point) -> list[float]:
    return [point.x, point.y, point.z]


def test_scenes_say_what_they_are_in_words_that_foxglove_knows(replayed):
    with replayed.output.open("rb") as file:
        summary = make_reader(file).get_summary()
    kinds = {channel.topic: summary.schemas[channel.schema_id] for channel in summary.channels.values()}
    assert kinds["/pomona/fruits"].name == kinds["/pomona/robot"].name == "foxglove_msgs/msg/SceneUpdate"
    assert kinds["/pomona/fruits"].encoding == "ros2msg"
    assert b"MSG: foxglove_msgs/SpherePrimitive" in kinds["/pomona/fruits"].data
    late = next(channel for channel in summary.channels.values() if channel.topic == "/pomona/fruits")
    assert "durability: 1" in late.metadata["offered_qos_profiles"]
    assert len(replayed.decoded["/pomona/fruits"]) == 1
    assert len(replayed.decoded["/pomona/robot"]) == len(FRAMES)


def test_a_replayed_bag_is_still_a_recording(replayed, pomona):
    code, out, _ = pomona("info", replayed.output)
    assert code == 0
    assert "/stereo/left/image_rect_color" in out


def test_the_same_bag_gives_the_same_bytes(replayed, tmp_path):
    again = tmp_path / "again.mcap"
    assert replay(replayed.bag.path, again, "--map", MAP, "--detections", replayed.bag.boxes).returncode == 0
    assert again.read_bytes() == replayed.output.read_bytes()


@pytest.mark.parametrize(("form", "tree"), [("ros1 lz4", "tf"), ("sqlite3", "odometry"), ("mcap", "none")])
def test_bags_of_all_kinds_become_bags_of_ros2(tmp_path, form, tree):
    bag = make_robot_bag(tmp_path / "in", form, tree=tree)
    output = tmp_path / "out.mcap"
    done = replay(bag.path, output, "--map", MAP, "--detections", bag.boxes, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    order, decoded = read(output)
    assert told["n_copied"] == len(entries(tree))
    assert len(order) == told["n_copied"] + told["n_added"]
    pictures = decoded["/stereo/left/image_rect_color"]
    assert [(each.header.frame_id, each.width) for each in pictures] == [(CAMERA, 640)] * len(FRAMES)
    root, body = {"tf": ("odom", BASE), "odometry": ("odom", BASE), "none": (CAMERA, f"{CAMERA}_body")}[tree]
    assert (told["frames"]["root"], told["frames"]["base"]) == (root, body)
    steps = [each.transforms[0] for each in decoded["/tf"]]
    ours = [step for step in steps if step.header.frame_id == "map"]
    assert {step.child_frame_id for step in ours} == {root}
    if tree == "none":
        static = decoded["/tf_static"][0].transforms[0]
        assert (static.header.frame_id, static.child_frame_id) == (CAMERA, body)
        through = matrix(ours[0].transform) @ matrix(static.transform)
        np.testing.assert_allclose(through, matrix(decoded["/pomona/pose"][0].pose.pose), atol=1e-6)


def test_up_levels_a_map_in_the_axes_of_a_camera(replayed, tmp_path):
    camera_axes = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    lying, output = tmp_path / "lying.csv", tmp_path / "out.mcap"
    FruitCloud.read(MAP).transformed(camera_axes).write(lying)
    done = replay(replayed.bag.path, output, "--map", lying, "--detections", replayed.bag.boxes, "--up", "0,-1,0")
    assert done.returncode == 0, done.stderr
    _, decoded = read(output)
    for levelled, upright in zip(decoded["/pomona/pose"], replayed.decoded["/pomona/pose"], strict=True):
        np.testing.assert_allclose(matrix(levelled.pose.pose), matrix(upright.pose.pose), atol=0.03)


def test_a_frame_map_of_the_bag_keeps_its_name(tmp_path):
    bag = make_robot_bag(tmp_path / "in")
    path = write_bag(tmp_path / "mapped", [*entries(), tf("/tf_static", START_NS, ("map", "odom", np.eye(4)))], "mcap")
    output = tmp_path / "out.mcap"
    done = replay(path, output, "--map", MAP, "--detections", bag.boxes, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["frames"] == {
        "map": "pomona_map",
        "root": "map",
        "base": BASE,
        "camera": CAMERA,
    }


@pytest.mark.parametrize("name", ["", " ", "/a b\n"])
def test_a_frame_that_no_robot_could_name_is_refused(replayed, tmp_path, name):
    output = tmp_path / "out.mcap"
    flags = ("--map", MAP, "--detections", replayed.bag.boxes, "--map-frame", name)
    refused(replay(replayed.bag.path, output, *flags), output, "--map-frame: found ", "expected a name of letters")


def test_no_frame_found_is_a_result(tmp_path):
    bag = make_robot_bag(tmp_path / "in")
    rows = np.random.default_rng(1).uniform(0, (6, 1, 2), (300, 3))
    elsewhere, output = tmp_path / "elsewhere.csv", tmp_path / "out.mcap"
    elsewhere.write_text("x,y,z\n" + "".join(f"{x:.3f},{y:.3f},{z:.3f}\n" for x, y, z in rows))
    done = replay(bag.path, output, "--map", elsewhere, "--detections", bag.boxes)
    assert done.returncode == 1
    _, decoded = read(output)
    assert len(decoded["/pomona/status"]) == len(FRAMES)
    assert "Found" not in {status.data for status in decoded["/pomona/status"]}
    assert not decoded["/pomona/pose"]


def test_nothing_is_overwritten(replayed, tmp_path):
    taken = tmp_path / "taken.mcap"
    taken.write_bytes(b"years of work")
    for flags in ((), ("--force",)):
        done = replay(replayed.bag.path, taken, "--map", MAP, "--detections", replayed.bag.boxes, *flags)
        assert done.returncode == 2
        assert "is there already" in done.stderr
        assert taken.read_bytes() == b"years of work"


def test_only_an_mcap_is_called_so_and_pipes_get_one_too(replayed, tmp_path):
    output = tmp_path / "out.bag"
    refused(replay(replayed.bag.path, output, "--map", MAP), output, "found suffix '.bag', expected .mcap")
    command = [sys.executable, "-m", "pomona", "ros", "replay", str(replayed.bag.path), "-", "--map", str(MAP)]
    done = subprocess.run([*command, "--detections", str(replayed.bag.boxes)], capture_output=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout == replayed.output.read_bytes()


def test_a_replayed_bag_is_not_replayed_again(replayed, tmp_path):
    done = replay(replayed.output, tmp_path / "twice.mcap", "--map", MAP, "--detections", replayed.bag.boxes)
    refused(done, tmp_path / "twice.mcap", "replayed already", "/pomona/detections")


def test_what_is_no_bag_is_refused(tmp_path):
    output = tmp_path / "out.mcap"
    refused(replay(MAP.parent / "row.mp4", output, "--map", MAP), output, "found side-by-side video", "expected a bag")


def test_a_bag_without_cameras_or_pictures_is_refused(tmp_path):
    output = tmp_path / "out.mcap"
    only = [entry for entry in entries() if not entry[0].endswith("camera_info")]
    bare = write_bag(tmp_path / "bare", only, "mcap")
    refused(replay(bare, output, "--map", MAP), output, "camera_info")
    blind = write_bag(tmp_path / "blind", [entry for entry in entries() if "stereo" not in entry[0]], "mcap")
    refused(replay(blind, output, "--map", MAP), output, "found no", "blind")


def test_time_that_goes_back_is_refused(tmp_path):
    output = tmp_path / "out.mcap"
    back = [*stereo(2), info("/stereo/left/camera_info", START_NS)]
    topic, _, kind, fields = image(
        "/stereo/left/image_rect_color", START_NS - 1, np.zeros((48, 64, 3), np.uint8), "bgr8"
    )
    bag = write_bag(tmp_path / "back", [*back, (topic, START_NS + 10**9, kind, fields)], "mcap")
    refused(replay(bag, output, "--map", MAP), output, "time goes back")


@pytest.mark.parametrize("form", ["mcap", "ros1", "sqlite3"])
def test_of_a_bag_that_was_cut_off_what_is_there_is_replayed(tmp_path, form):
    bag = make_robot_bag(tmp_path / "in", form)
    cut = tmp_path / bag.path.with_suffix(bag.path.suffix or ".db3").name
    whole = next(bag.path.glob("*.db3")) if bag.path.is_dir() else bag.path
    cut.write_bytes(whole.read_bytes()[: int(0.8 * whole.stat().st_size)])
    boxes, output = tmp_path / "boxes.csv", tmp_path / "out.mcap"
    # Boxes of frames that are lost are refused: of the last frame there are none.
    lines = bag.boxes.read_text().splitlines(keepends=True)
    boxes.write_text("".join(line for line in lines if not line.startswith(f"{len(FRAMES) - 1},")))
    done = replay(cut, output, "--map", MAP, "--detections", boxes, "--json")
    assert done.returncode == 0, done.stderr
    assert "cut off" in done.stderr
    told = json.loads(done.stdout)
    assert 0 < told["n_found"] < len(FRAMES)
    order, _ = read(output)
    assert 0 < told["n_copied"] < len(entries())
    assert len(order) == told["n_copied"] + told["n_added"]


def test_a_missing_package_is_one_line(tmp_path):
    bag = make_robot_bag(tmp_path / "in")
    blocked = "import sys; sys.modules.update(rosbags=None, mcap=None); sys.argv[0] = 'pomona'\n"
    program = blocked + "from pomona.cli import main; main()"
    arguments = ("ros", "replay", bag.path, tmp_path / "out.mcap", "--map", MAP)
    command = [sys.executable, "-c", program, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    refused(done, tmp_path / "out.mcap", "pip install mcap rosbags")


def test_definitions_travel_with_their_topics(replayed):
    """Who reads the copy needs to know no types."""
    topics = open_messages(replayed.output).topics
    known = known_store()
    for topic in topics.values():
        assert topic.language == "ros2msg"
        assert topic.definition
        assert topic.type in known.fielddefs


def test_every_topic_has_one_channel(replayed):
    with replayed.output.open("rb") as file:
        channels = make_reader(file).get_summary().channels.values()
    names = [channel.topic for channel in channels]
    assert len(names) == len(set(names))


def a_message(kind: str, definition: bytes, body: bytes = b"") -> Message:
    return Message(Topic("/a", kind, "ros1", "ros1msg", definition), 0, body)


def test_types_of_ros1_that_ros2_does_not_know_go_with_their_definitions():
    made = AsRos2(Path("a.bag"))(a_message("mine/msg/Load", b"Header header\nfloat32[2] kg\ntime at\n" + HEADER, LOAD))
    assert made is not None
    assert (made.topic.encoding, made.topic.language) == ("cdr", "ros2msg")
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(made.topic.definition.decode(), "mine/msg/Load"))
    read = store.deserialize_cdr(made.body, "mine/msg/Load")
    assert (read.header.stamp.sec, read.header.frame_id, read.kg.tolist(), read.at.sec) == (5, "ab", [1.0, 2.5], 9)


HEADER = b"=" * 80 + b"\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
LOAD = struct.pack("<IIII2s2fII", 1, 5, 6, 2, b"ab", 1.0, 2.5, 9, 8)


@pytest.mark.parametrize(
    ("kind", "definition", "body"),
    [
        ("a/msg/B:\n    raise SystemExit('run')\nclass C", b"uint8 a", b"\0"),
        ("a/msg/B", b"std_msgs/Empty[99999999] a\n" + b"=" * 80 + b"\nMSG: std_msgs/Empty\n", b"\0"),
        ("a/msg/B", b"not a definition", b"\0"),
        ("a/msg/B", b"a/B[] more", b"\xff\xff\xff\xff"),
        ("a/msg/B", b"uint32 a", b"\0"),
    ],
)
def test_a_strangers_type_that_makes_no_sense_is_left_out_and_told(kind, definition, body):
    as_ros2 = AsRos2(Path("a.bag"))
    with pytest.warns(PomonaWarning, match=r"a.bag: /a: found a message that is no") as told:
        made = [as_ros2(a_message(kind, definition, body)) for _ in range(2)]
    assert made == [None, None]
    assert len(told) == 1


def with_tree(tmp_path: Path, *told: tuple[str, str, str, np.ndarray]) -> BagRecording:
    """The robot's bag with another tree: topic, parent, child and where, told at the time of each picture."""
    pictures = [entry for entry in entries("none") if entry[0] != "/goal"]
    tree = [
        tf(topic, START_NS + row * STEP_NS, (parent, child, where))
        for row in range(len(FRAMES))
        for topic, parent, child, where in told
    ]
    return open_recording(write_bag(tmp_path / "drive", [*pictures, *tree], "ros2 mcap"))


FIXED, MOVING = "/tf_static", "/tf"


def test_frames_in_a_circle_are_refused(tmp_path):
    bag = with_tree(tmp_path, (FIXED, BASE, CAMERA, BASE_FROM_CAMERA), (FIXED, "a", BASE, EYE), (FIXED, BASE, "a", EYE))
    with pytest.raises(PomonaError, match=r"drive.*: found frames in a circle, 'base_link' in 'a' in 'base_link', exp"):
        frames_of_bag(bag, "map", EYE)


def test_of_two_frames_that_a_frame_is_told_to_be_in_the_last_counts(tmp_path):
    away = np.eye(4)
    away[0, 3] = 100.0
    bag = with_tree(
        tmp_path,
        (FIXED, BASE, CAMERA, BASE_FROM_CAMERA),
        (MOVING, "world", BASE, away),
        (MOVING, "odom", BASE, EYE),
    )
    with pytest.warns(PomonaWarning, match="found the frame 'base_link' in 'odom', 'world': the last, 'odom', counts"):
        frames = frames_of_bag(bag, "map", EYE)
    assert frames.root == "odom"
    np.testing.assert_allclose(frames.map_from_root(away, START_NS), away, atol=1e-12)


def test_frames_without_a_name_in_themselves_or_nowhere_are_none(tmp_path):
    """As tf2 has it, which ignores them."""
    lost = np.full((4, 4), np.nan)
    bag = with_tree(
        tmp_path,
        (FIXED, BASE, CAMERA, BASE_FROM_CAMERA),
        (FIXED, CAMERA, CAMERA, EYE),
        (FIXED, "", BASE, EYE),
        (FIXED, "nowhere", BASE, lost),
        (MOVING, "odom", BASE, EYE),
    )
    frames = frames_of_bag(bag, "map", EYE)
    assert (frames.root, frames.robot.base, frames.robot.camera) == ("odom", BASE, CAMERA)
