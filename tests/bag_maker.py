"""Real bags, written by rosbags and mcap: a stereo or RGB-D camera that sees known noise; and how they are refused."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

import refusal
from pomona.recording import open_recording

SIZE = (64, 48)
START_NS = 1_723_190_400 * 10**9  # 2024-08-09T08:00:00 UTC
STEP_NS = 100_000_000

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.LATEST)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))

FORMATS = ("ros1", "ros1 lz4", "sqlite3", "ros2 mcap", "mcap", "mcap lz4")

Entry = tuple[str, int, str, dict[str, Any]]
"""Topic, time of logging, type without package path, fields."""


def picture(seed: int, size=SIZE, channels=3, dtype=np.uint8):
    top = 256 if dtype == np.uint8 else 5000
    shape = (size[1], size[0], channels) if channels > 1 else (size[1], size[0])
    return np.random.default_rng(seed).integers(0, top, shape).astype(dtype)


def image(topic: str, stamp_ns: int, pixels, encoding: str, frame="cam", *, pad=0, late_ns=0) -> Entry:
    """A raw image; `pad` bytes are appended to each row."""
    height, width = pixels.shape[:2]
    rows = pixels.reshape(height, -1).view(np.uint8)
    rows = np.hstack([rows, np.full((height, pad), 77, np.uint8)])
    fields = {"stamp_ns": stamp_ns, "frame_id": frame, "height": height, "width": width, "encoding": encoding}
    return topic, stamp_ns + late_ns, "sensor_msgs/msg/Image", fields | {"step": rows.shape[1], "data": rows.ravel()}


def compressed(topic: str, stamp_ns: int, format: str, content: bytes, frame="cam") -> Entry:  # noqa: A002
    fields = {"stamp_ns": stamp_ns, "frame_id": frame, "format": format, "data": np.frombuffer(content, np.uint8)}
    return topic, stamp_ns, "sensor_msgs/msg/CompressedImage", fields


def compressed_depth(topic: str, stamp_ns: int, depth, quantisation=None) -> Entry:
    """As compressed_depth_image_transport does it: 16UC1 as it is, 32FC1 as inverse depth with A and B."""
    if quantisation is None:
        head, codes, name = struct.pack("<i2f", 0, 0.0, 0.0), depth, "16UC1"
    else:
        a, b = quantisation
        head, name = struct.pack("<i2f", 1, a, b), "32FC1"
        with np.errstate(divide="ignore"):
            codes = np.where(depth > 0, np.round(a / depth + b), 0).astype(np.uint16)
    content = head + cv2.imencode(".png", codes)[1].tobytes()
    return compressed(topic, stamp_ns, f"{name}; compressedDepth png", content)


def info(topic: str, stamp_ns: int, shift=0.0, *, f=60.0, size=SIZE, frame="cam", **changes) -> Entry:
    """A camera_info whose projection has `shift` = -fx baseline."""
    cx, cy = (size[0] - 1) / 2, (size[1] - 1) / 2
    fields = {
        "stamp_ns": stamp_ns,
        "frame_id": frame,
        "width": size[0],
        "height": size[1],
        "distortion_model": "plumb_bob",
        "D": np.zeros(5),
        "K": np.array([f, 0, cx, 0, f, cy, 0, 0, 1.0]),
        "R": np.eye(3).ravel(),
        "P": np.array([f, 0, cx, shift, 0, f, cy, 0, 0, 0, 1.0, 0]),
    }
    return topic, stamp_ns, "sensor_msgs/msg/CameraInfo", fields | changes


def stereo(n_frames=4, *, left="/stereo/left", right="/stereo/right", baseline_m=0.12, late_ns=0) -> list[Entry]:
    """Rectified pairs; the right camera's stamps are `late_ns` later."""
    entries = []
    for row in range(n_frames):
        at = START_NS + row * STEP_NS
        entries += [
            info(f"{left}/camera_info", at),
            info(f"{right}/camera_info", at + late_ns, -60.0 * baseline_m),
            image(f"{left}/image_rect_color", at, picture(row), "bgr8"),
            image(f"{right}/image_rect_color", at + late_ns, picture(1000 + row), "bgr8"),
        ]
    return entries


def odometry(topic: str, stamp_ns: int, pose, child="base_link", frame="odom") -> Entry:
    """A pose (4, 4) of the body; an empty child makes it a PoseStamped."""
    fields = {"stamp_ns": stamp_ns, "frame_id": frame, "pose": np.asarray(pose)}
    kind = "nav_msgs/msg/Odometry" if child else "geometry_msgs/msg/PoseStamped"
    return topic, stamp_ns, kind, fields | ({"child_frame_id": child} if child else {})


def tf(topic: str, stamp_ns: int, *transforms: tuple[str, str, Any]) -> Entry:
    """Transforms (parent, child, parent_from_child)."""
    return topic, stamp_ns, "tf2_msgs/msg/TFMessage", {"at_ns": stamp_ns, "transforms": transforms}


def message(store, kind: str, fields: dict[str, Any]):
    """Build a message of either ROS from flat fields."""
    types, ros1 = store.types, store is ROS1
    fields = dict(fields)
    if "stamp_ns" in fields:
        stamp_ns, frame = fields.pop("stamp_ns"), fields.pop("frame_id", "")
        stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        header = {"stamp": stamp, "frame_id": frame} | ({"seq": 0} if ros1 else {})
        fields["header"] = types["std_msgs/msg/Header"](**header)
    if kind == "tf2_msgs/msg/TFMessage":
        return _tf_message(store, fields)
    if kind == "geometry_msgs/msg/Transform":
        return _transform(store, fields["matrix"])
    if "pose" in fields:
        fields["pose"] = _pose(store, fields["pose"], covariance="Odometry" in kind)
    if kind == "nav_msgs/msg/Odometry":
        zero = types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
        twist = types["geometry_msgs/msg/Twist"](linear=zero, angular=zero)
        fields["twist"] = types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36))
    if kind == "sensor_msgs/msg/Image":
        fields.setdefault("is_bigendian", 0)
    if kind == "sensor_msgs/msg/CameraInfo":
        fields |= {"binning_x": 0, "binning_y": 0}
        roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        fields["roi"] = types["sensor_msgs/msg/RegionOfInterest"](**roi)
        if not ros1:
            fields = {name.lower(): value for name, value in fields.items()}
    return types[kind](**fields)


def _quaternion(store, pose):
    """Of a pose that is NaN in its last row, too."""
    if np.isnan(np.asarray(pose)[3]).any():
        return store.types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=float("nan"))
    turn = Rotation.from_matrix(np.asarray(pose)[:3, :3]).as_quat()
    return store.types["geometry_msgs/msg/Quaternion"](**dict(zip("xyzw", turn.tolist(), strict=True)))


def _pose(store, pose, *, covariance: bool):
    place = dict(zip("xyz", np.asarray(pose)[:3, 3].tolist(), strict=True))
    point = store.types["geometry_msgs/msg/Point"](**place)
    plain = store.types["geometry_msgs/msg/Pose"](position=point, orientation=_quaternion(store, pose))
    if not covariance:
        return plain
    return store.types["geometry_msgs/msg/PoseWithCovariance"](pose=plain, covariance=np.zeros(36))


def _transform(store, matrix):
    place = dict(zip("xyz", np.asarray(matrix)[:3, 3].tolist(), strict=True))
    translation = store.types["geometry_msgs/msg/Vector3"](**place)
    return store.types["geometry_msgs/msg/Transform"](translation=translation, rotation=_quaternion(store, matrix))


def _tf_message(store, fields):
    types = store.types
    entries = []
    for parent, child, pose in fields["transforms"]:
        stamp_ns = fields["at_ns"]
        stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        header = {"stamp": stamp, "frame_id": parent} | ({"seq": 0} if store is ROS1 else {})
        stamped = types["geometry_msgs/msg/TransformStamped"]
        header = types["std_msgs/msg/Header"](**header)
        entries.append(stamped(header=header, child_frame_id=child, transform=_transform(store, pose)))
    return types["tf2_msgs/msg/TFMessage"](transforms=entries)


def write_bag(path: Path, entries: Iterable[Entry], form: str) -> Path:
    """Write entries in the order of logging, in one of `FORMATS`; give the path to open."""
    entries = sorted(entries, key=lambda entry: entry[1])
    if form.startswith("ros1"):
        return _write_ros1(path.with_suffix(".bag"), entries, lz4="lz4" in form)
    if form.startswith("mcap"):
        return _write_mcap(path.with_suffix(".mcap"), entries, compression="lz4" if "lz4" in form else "zstd")
    plugin = rosbag2.StoragePlugin.MCAP if "mcap" in form else rosbag2.StoragePlugin.SQLITE3
    writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
    if "zstd" in form:
        mode = rosbag2.CompressionMode[form.split()[-1].upper()]
        writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, logged_ns, kind, fields in entries:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS2)
            writer.write(connections[topic], logged_ns, ROS2.serialize_cdr(message(ROS2, kind, fields), kind))
    return path


def _write_ros1(path: Path, entries: list[Entry], *, lz4: bool) -> Path:
    writer = rosbag1.Writer(path)
    if lz4:
        writer.set_compression(rosbag1.Writer.CompressionFormat.LZ4)
    with writer:
        connections = {}
        for topic, logged_ns, kind, fields in entries:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS1)
            writer.write(connections[topic], logged_ns, ROS1.serialize_ros1(message(ROS1, kind, fields), kind))
    return path


def _write_mcap(path: Path, entries: list[Entry], *, compression: str, chunk_size=64 * 1024) -> Path:
    """By the other library, without ROS' profile and schemas, as many converters do."""
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_size, compression=CompressionType[compression.upper()])
        writer.start()
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        for topic, logged_ns, kind, fields in entries:
            if kind not in schemas:
                schemas[kind] = writer.register_schema(kind, "ros2msg", b"")
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", schemas[kind])
            body = bytes(ROS2.serialize_cdr(message(ROS2, kind, fields), kind))
            writer.add_message(channels[topic], logged_ns, body, logged_ns)
        writer.finish()
    return path


def rgbd(depths, *, colour=None, depth_topic="/camera/aligned_depth_to_color/image_raw", encoding="16UC1"):
    """Frames of /camera/color and of depth in its picture."""
    entries = []
    for row, depth in enumerate(depths):
        at = START_NS + row * STEP_NS
        entries += [
            info("/camera/color/camera_info", at),
            image("/camera/color/image_raw", at, picture(row) if colour is None else colour, "rgb8"),
            info(depth_topic.rpartition("/")[0] + "/camera_info", at),
            image(depth_topic, at + 1000, depth, encoding),
        ]
    return entries


def refused(path, *parts, **options):
    """Expect one line that holds these parts."""
    refusal.refused(lambda: open_recording(path, **options), *parts)
